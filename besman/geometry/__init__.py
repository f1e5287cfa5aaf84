"""Frames, quaternions, gaps and rigid clusters: arrays in, arrays out."""
