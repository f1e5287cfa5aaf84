"""Actions made of building blocks."""
