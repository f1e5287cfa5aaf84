"""Loaded after all else in a process that others are forked from: none of it is garbage.

Loky has all that is not kept looked through once a second, in every worker.
"""

from __future__ import annotations

from besman.work.garbage import keep_all
from besman.work.in_worker import limit_threads

# Once for all, in place of in each.
limit_threads()
keep_all()
