"""The steps of the agent `oracle` in the frozen eval episodes of v1, made by benchmarks/oracle_steps.py."""
