"""Reach where the hand reached."""
