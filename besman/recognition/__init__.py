"""Recognition of building blocks."""
