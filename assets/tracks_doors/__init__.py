"""The benchmark `tracks-doors`: frozen episodes of the track `doors` in the mazes of the benchmark `tracks`."""
