"""Work on many items: threads, processes, a cluster."""
