"""Speed of the simulation, the environments and the learners, for `mazebench bench`."""
