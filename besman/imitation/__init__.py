"""Imitation: a joint trajectory as a dynamical movement primitive."""
