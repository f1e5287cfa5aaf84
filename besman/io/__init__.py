"""Files in and out: recordings and segments."""
