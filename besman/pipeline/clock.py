"""What a stage costs: a row of ``timing.json``."""

from __future__ import annotations

import os
import time
from typing import Any

from besman.config.stage import Items
from besman.work.in_worker import peak_rss_mb
from besman.work.outcome import Notes


class Clock:
    """Wall and CPU time from the moment that it is made."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), _cpu_seconds()

    @property
    def wall_s(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._wall

    def row(
        self,
        name: str,
        items: Items,
        notes: Notes | None = None,
        *,
        computed: float | None = None,
        cached: bool = False,
    ) -> dict[str, Any]:
        """Return what was spent so far as a row of the timing table.

        Parameters
        ----------
        name : str
            Of the stage.
        items : Items
            How many of what were worked on.
        notes : Notes, optional
            Account of worker processes, and of what failed.
        computed : float, optional
            Wall seconds that the computation took when it was made.
        cached : bool
            Whether the result was loaded.
        """
        spent, cpu = self.wall_s, _cpu_seconds() - self._cpu
        notes = Notes() if notes is None else notes
        return {
            "name": name,
            "wall_s": spent,
            "cpu_s": cpu + notes.cpu_s,
            "human": False,
            "items": items.n,
            "unit": items.unit,
            "cached": cached,
            "computed_wall_s": spent if computed is None else computed,
            "peak_rss_mb": peak_rss_mb(),
            "workers": {
                "n": len(notes.workers),
                "peak_rss_mb": max(notes.workers.values(), default=None),
            },
        }


def _cpu_seconds() -> float:
    """Return the CPU time of this process, seconds; workers give account of theirs."""
    times = os.times()
    return times.user + times.system
