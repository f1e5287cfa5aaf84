"""Throw a ball from a scoop."""
