"""What a search has tried so far, on disk: a killed one goes on where it was.

A search is repeatable: a new one that is told the same returns asks for the same points. So the
generations tried are all there is to keep, whatever the search keeps in its memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RunError
from besman.io.atomic_files import make_folder, write_record
from besman.records import Record, freeze
from besman.records.files import load_record
from besman.simulation.trial import Trial

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Generation(
    Record,
    stored_as="besman.refinement.checkpoint:Generation",
    finite=("points",),
    later=("worlds",),
):
    """One generation of a search.

    Attributes
    ----------
    points : array, shape (P, D)
        What was asked for.
    trials : tuple of Trial
        What came of them; fewer than P where the budget ended.
    worlds : tuple of tuple of Trial
        What came of each of these in every perturbed model, if they were tried there.
    """

    points: FloatArray
    trials: tuple[Trial, ...]
    worlds: tuple[tuple[Trial, ...], ...] = ()

    def __post_init__(self) -> None:
        """Copy the points, make them read-only and check their shape."""
        freeze(self, {"points": ("P", "D")})


class Checkpoint:
    """The generations of one search, a file for each.

    Parameters
    ----------
    folder : Path or None
        Of the searches of a stage; None, or a folder that cannot be seen from here (of a worker of
        a cluster without a common file system): nothing is kept.
    name : str
        Of the search: no two of a folder have the same.
    """

    def __init__(self, folder: Path | None, name: str) -> None:
        self._folder = folder / name if folder is not None and folder.is_dir() else None

    def load(self) -> list[Generation]:
        """Return the generations kept so far; the first that is damaged ends them."""
        generations: list[Generation] = []
        while self._folder is not None:
            path = self._path(len(generations))
            if not path.is_file():
                break
            try:
                found = load_record(path)
            except RunError:
                break
            if not isinstance(found, Generation):
                break
            generations.append(found)
        return generations

    def save(self, index: int, generation: Generation) -> None:
        """Keep a generation; a reader sees all of it or nothing."""
        if self._folder is None:
            return
        make_folder(self._folder)
        write_record(self._path(index), generation, durable=False)

    def _path(self, index: int) -> Path:
        assert self._folder is not None
        return self._folder / f"{index:06d}.npz"
