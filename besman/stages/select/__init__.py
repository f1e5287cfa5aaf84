"""The demonstrations of a class, as hand trajectories."""
