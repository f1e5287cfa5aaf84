"""Recordings and their manual segments, from files."""
