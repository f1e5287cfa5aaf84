"""The stages of a pipeline: folders bear the names of its keys."""
