"""Driving by hand in MuJoCo's viewer, and films of episodes."""
