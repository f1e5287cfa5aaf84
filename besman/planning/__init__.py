"""Whole tasks that nobody has shown: learnt blocks in another order, at other places."""
