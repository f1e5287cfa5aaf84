"""Search in simulation until the task succeeds."""
