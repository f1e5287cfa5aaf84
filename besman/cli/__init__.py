"""The command line: one file a group of commands."""

from besman.work.garbage import collect_seldom

# Before the rest is loaded.
collect_seldom()
