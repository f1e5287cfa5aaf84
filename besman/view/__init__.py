"""A run in the browser: person and robot side by side, live or as one file."""
