"""One file without a pipeline: segment it, name its markers, learn from it."""

LONGEST_GAP_S = 0.5
"""Gaps up to this are filled where there is no recipe to say otherwise, seconds."""
