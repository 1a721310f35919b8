"""Mazes: the value, its files and pictures, generators, perturbations, shortest paths, and the frozen benchmark."""

# Here, where it costs no import, because `import mazebench` registers an environment for each.
BENCHMARK_SIZES = (13, 15, 17, 19, 21)
