"""Behaviour templates: a motion for every target, learnt once."""
