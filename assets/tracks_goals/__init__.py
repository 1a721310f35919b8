"""The benchmark `tracks-goals`: later goals of the frozen episodes of the benchmark `tracks`."""
