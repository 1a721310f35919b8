"""Benchmark v3: mazes of several kinds, in the splits train and dev, and their frozen episodes."""
