"""Motion plans of joint trajectories."""
