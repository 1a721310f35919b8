"""Frozen mazes and episodes of the benchmark `paper`."""
