"""Borders of building blocks."""
