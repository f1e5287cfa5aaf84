"""Motion plans: dynamical movement primitives, their rollout, and other starts and goals."""
