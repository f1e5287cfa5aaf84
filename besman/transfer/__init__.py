"""From simulation to the real arm: what to try next, and what was learnt from what was tried."""
