"""Names for the trajectories of a recording."""
