"""Running capture systems as streams of frames: protocols, and what networks do to packets."""
