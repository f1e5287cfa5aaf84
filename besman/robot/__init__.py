"""Robot arms: description, kinematics, collisions, limits."""
