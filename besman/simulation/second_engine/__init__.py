"""The tasks in a second physics engine, which shares no code with the first."""
