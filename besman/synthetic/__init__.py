"""Captures of a simulated person, with known truth."""
