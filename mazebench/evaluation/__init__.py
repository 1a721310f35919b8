"""Evaluations: what is run, how, and the folders that it fills."""
