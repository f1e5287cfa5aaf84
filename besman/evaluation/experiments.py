"""Experiments by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from besman.evaluation.labelling import evaluate_labelling, labelling_table
from besman.exceptions import ConfigError, nearest

if TYPE_CHECKING:
    from rich.table import Table

EXPERIMENTS = ("labelling",)


def run_experiment(
    name: str, data: Path | None, n_seeds: int, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Run an experiment.

    Parameters
    ----------
    name : str
        One of `EXPERIMENTS`.
    data : Path, optional
        Folder of recordings; the embedded sample if not given.
    n_seeds : int
        Repetitions of what is random.
    progress : callable
        Called with the share done.

    Returns
    -------
    dict
        ``experiment`` and ``rows``.

    Raises
    ------
    ConfigError
        If there is no such experiment.
    """
    if name not in EXPERIMENTS:
        raise ConfigError(f"evaluate: no experiment {name!r}; {nearest(name, EXPERIMENTS)}")
    return evaluate_labelling(data, n_seeds, progress)


def show_experiment(result: dict[str, Any]) -> Table:
    """Return an experiment's rows as a table for the terminal."""
    return labelling_table(result["rows"])
