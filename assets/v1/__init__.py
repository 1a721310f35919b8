"""Frozen mazes and episodes of benchmark v1."""
