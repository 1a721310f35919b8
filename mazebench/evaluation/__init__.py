"""Evaluations: protocols, runs, metrics, tables and films."""
