"""The reference agents of mazebench, imported as `mazebench_agents`.

    >>> mazebench.evaluate("navigator", "rebuilt", level=2, split="dev").overall.success_rate

`mazebench list` names the agents. Besides them, `mazebench_agents.expert` has labels of the oracle for imitation, and
`mazebench_agents.integrations.sb3` has environments for Stable-Baselines3.
"""
