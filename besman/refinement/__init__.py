"""Refinement: motion plans are changed by search until the simulated task succeeds."""
