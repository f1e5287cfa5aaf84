"""How each motion stands a wrong model: cells for the page, a table for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from besman.report.centimetres import centimetres

if TYPE_CHECKING:
    from rich.table import Table

    from besman.stages.refine.robustness import Robustness

ROBUSTNESS_HEADER = ["perturbed: success", "perturbed: miss, 95 %", "shift at dt/4"]


def robustness_cells(found: Robustness | None) -> list[str]:
    """Return the cells of one motion under `ROBUSTNESS_HEADER`; empty ones without a motion.

    Parameters
    ----------
    found : Robustness, optional
        What came of it.
    """
    if found is None:
        return [""] * len(ROBUSTNESS_HEADER)
    misses = found.misses[np.isfinite(found.misses)]
    return [
        f"{found.success.sum()} / {len(found.success)}" if len(found.success) else "",
        centimetres(float(np.quantile(misses, 0.95))) if len(misses) else "",
        centimetres(found.shift),
    ]


def robustness_table(found: Sequence[Robustness]) -> Table:
    """Return one row a motion.

    Parameters
    ----------
    found : sequence of Robustness
    """
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("motion")
    for name in ROBUSTNESS_HEADER:
        table.add_column(name, justify="right")
    for one in found:
        table.add_row(one.name, *robustness_cells(one))
    return table
