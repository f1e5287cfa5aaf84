"""The table of the runs in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from besman.pipeline.runs import ListedRun

if TYPE_CHECKING:
    from rich.table import Table


def runs_table(runs: tuple[ListedRun, ...], folder: Path) -> Table:
    """Return one row a run: its place below the folder, status, recipe and size.

    Parameters
    ----------
    runs : tuple of ListedRun
    folder : Path
        Where they were looked for.
    """
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    for name in ("run", "status", "recipe"):
        table.add_column(name)
    table.add_column("size", justify="right", no_wrap=True)
    for run in runs:
        status = f"{run.status}: {run.error}" if run.error else run.status
        place = str(run.folder.relative_to(folder))
        table.add_row(place, status, run.recipe, size(run.n_bytes))
    return table


def size(n_bytes: int) -> str:
    """Write a size for people: ``812 B``, ``3.4 kB``, ``16 MB``, ``1.2 GB``."""
    value = float(n_bytes)
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.0f} {unit}" if unit == "B" or value >= 10 else f"{value:.1f} {unit}"
        value /= 1000
    return f"{value:.1f} GB"
