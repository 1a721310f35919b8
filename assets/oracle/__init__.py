"""The SPL of the agent `oracle` in the frozen eval episodes, made by benchmarks/oracle_spl.py."""
