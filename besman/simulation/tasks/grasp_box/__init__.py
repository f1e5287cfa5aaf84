"""Grasp a box with three fingers and lift it."""
