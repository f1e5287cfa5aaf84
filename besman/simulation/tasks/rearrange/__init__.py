"""Carry boxes from where they stand to where they are put."""
