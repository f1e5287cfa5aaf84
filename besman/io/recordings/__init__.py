"""Recordings of every system: one file a format, `formats` is the table of them."""
