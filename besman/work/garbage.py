"""How often Python looks for garbage that reference counts do not free."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# New containers until a look at the young ones. Python's own 700 has it look some 300 times while
# a command imports what it needs, of which nothing is garbage.
_YOUNG = 50_000


def collect_seldom() -> None:
    """Have cyclic garbage looked for when there is more of it; 5 to 8 % of a short command."""
    gc.set_threshold(_YOUNG, *gc.get_threshold()[1:])


def keep_all() -> None:
    """Take all that there is for no garbage: what was loaded, or at the end, when all goes anyway.

    To look through what a run has loaded takes a tenth of a second, and Python does so at the end,
    more than once. Not for a process that goes on with other work: its garbage would stay.
    """
    gc.freeze()


@contextmanager
def keep_meanwhile() -> Iterator[None]:
    """Have what there is looked through now, and not again before this ends.

    What was kept before stays so: to look through all that was loaded, too, takes a tenth of a
    second, each time that this begins.
    """
    others_keep = gc.get_freeze_count() > 0
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        if not others_keep:
            gc.unfreeze()
