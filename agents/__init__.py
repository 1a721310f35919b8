"""The reference agents of mazebench, imported as `mazebench_agents`."""
