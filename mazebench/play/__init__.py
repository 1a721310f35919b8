"""Driving by hand, in MuJoCo's viewer or in a terminal."""
