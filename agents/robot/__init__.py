"""The robot's toolbox: what is the same in all agents that know how the body moves and measures."""
