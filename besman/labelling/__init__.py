"""From trajectories to named markers without gaps."""
