"""Names for building blocks, from labelled examples."""
