"""One file without a pipeline: segment it, name its markers, learn from it."""
