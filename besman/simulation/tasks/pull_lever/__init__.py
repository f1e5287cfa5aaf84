"""Pull a lever with a hook."""
