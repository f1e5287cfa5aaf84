"""Motions as files that robots and other programs read."""
