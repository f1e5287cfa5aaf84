"""Hand trajectories in the workspace of an arm, within its limits."""
