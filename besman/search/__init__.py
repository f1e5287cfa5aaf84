"""Black-box searches, with and without a context."""
