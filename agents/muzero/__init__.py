"""The parts of MuZero that the agents with a learned model share: search, losses, targets, learner."""
