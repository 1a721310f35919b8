"""Mazes: the value, its files and pictures, generators, shortest paths, and the frozen benchmark."""
