"""Results of evaluations: records on disk, metrics, intervals, comparisons."""
