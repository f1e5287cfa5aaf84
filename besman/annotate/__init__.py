"""Segments and marker names, given by hand on a page in the browser."""
