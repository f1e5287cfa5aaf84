"""Datasets of simulated captures, by name."""

from __future__ import annotations

from pathlib import Path

from besman.exceptions import ConfigError, nearest
from besman.synthetic import stick_throw
from besman.synthetic.capture import write_dataset

DATASETS = ("stick_throw",)


def write_synthetic(
    dataset: str,
    out: Path,
    n_subjects: int = 2,
    n_throws: int = 8,
    rate_hz: float = 100.0,
    seed: int = 0,
) -> list[Path]:
    """Simulate a dataset and write it; see `besman.synthetic.stick_throw.generate`.

    Parameters
    ----------
    dataset : str
        One of `DATASETS`.
    out : Path
        Folder to write to; made if it is not there.
    n_subjects, n_throws : int
        How many people, and how many throws each.
    rate_hz : float
        Frames per second.
    seed : int
        Another seed, other people.

    Returns
    -------
    list of Path
        The recordings written; each has its segments file beside it.

    Raises
    ------
    ConfigError
        If there is no such dataset or a number is out of range.
    RecordingError
        If a file is there already or cannot be written.
    """
    if dataset not in DATASETS:
        raise ConfigError(f"synth: no dataset {dataset!r}; {nearest(dataset, DATASETS)}")
    return write_dataset(stick_throw.generate(n_subjects, n_throws, rate_hz, seed), out)
