"""Training: the loop, run folders, and where experience comes from."""
