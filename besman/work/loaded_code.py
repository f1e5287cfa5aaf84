"""Loaded before all else in a process that others are forked from: they run what it has loaded.

So it is asked here which code that is, whatever becomes of the files until an item comes.
"""

from __future__ import annotations

from besman.work.versions import environment

environment()
