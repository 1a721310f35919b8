"""MMN's models as kernels, for searches on a CPU."""
