"""Segmentation of movements into building blocks."""
