"""Frozen mazes and episodes of benchmark v2, in which tracks are played."""
