"""Throw a stick with a ball at its end."""
