"""Blocks and actions while a person moves: segmentation, recognition and hierarchy, joined."""
