"""The parts that the learning agents share."""
