"""Perturbations of what the agent is shown and observes."""
