"""Mazes: the value, its files and pictures, generators, perturbations, shortest paths, and the frozen benchmark."""

# Kept here because `import mazebench` registers an environment for each size and must not import more.
BENCHMARK_SIZES = (13, 15, 17, 19, 21)
