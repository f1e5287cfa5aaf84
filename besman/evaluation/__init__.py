"""Experiments: one module for each table of the thesis."""
