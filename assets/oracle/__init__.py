"""The steps of `oracle` in the eval episodes of the paper's protocol, made by benchmarks/oracle_steps.py."""
