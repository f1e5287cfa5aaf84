"""Actions of building blocks."""
