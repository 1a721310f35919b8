"""Training: the loop, run folders, and collecting experience."""
