"""Building blocks of a recording, their names, and the actions that they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from besman.records.frozen import FloatArray, Record, ShapeError, freeze


@dataclass(frozen=True, eq=False)
class Segments(Record, stored_as="besman.records:Segments"):
    """Building blocks of one recording.

    Attributes
    ----------
    bounds : int array, shape (S, 2)
        Half-open row indices into the recording at its own rate.
    log_evidence : float
        Log-probability of the segmentation (NaN where the method has none).
    rate_hz, source, first_frame
        As in `Recording`.
    border_probability : array, shape (T,) or (0,)
        Posterior probability of a border in the sampling period of the method that each row of
        the recording lies in; empty where the method has none.
    """

    bounds: npt.NDArray[np.int64]
    log_evidence: float
    rate_hz: float
    source: str
    first_frame: int = 1
    border_probability: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        freeze(self, {"bounds": ("S", 2), "border_probability": ("T",)}, bounds=np.int64)

    def check(self) -> None:
        """Refuse bounds that are none, as `besman.records.frozen.Record.check` says."""
        super().check()
        check_rows(self.bounds, "Segments.bounds")


@dataclass(frozen=True, eq=False)
class LabelledSegments(Record, stored_as="besman.records:LabelledSegments"):
    """Building blocks with names. Manual segments are written as this record too.

    Attributes
    ----------
    bounds : int array, shape (S, 2)
        Half-open row indices into the recording at its own rate; may overlap in manual segments.
        Those of one layer do not.
    labels : tuple of str, length S
        One label per segment.
    distances : array, shape (S,)
        Uncertainty of each label: distance to the nearest training example, 0 for manual labels.
    rate_hz, source, first_frame
        As in `Recording`.
    layers : tuple of str, length S or 0
        What a person looked at when labelling: ``right_hand``, ``left_hand`` or ``actions`` (see
        `besman.records.layers`), "" for a segment without a layer; empty if no segment has one.
    """

    bounds: npt.NDArray[np.int64]
    labels: tuple[str, ...]
    distances: FloatArray
    rate_hz: float
    source: str
    first_frame: int = 1
    layers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, {"bounds": ("S", 2), "distances": ("S",)}, bounds=np.int64)
        if not any(self.layers) and len(self.layers) == len(self.bounds):
            object.__setattr__(self, "layers", ())
        for name, got in (("labels", len(self.labels)), ("layers", len(self.layers))):
            if got != len(self.bounds) and not (name == "layers" and got == 0):
                raise ShapeError(
                    f"LabelledSegments.{name} must have {len(self.bounds)} entries, got {got}"
                )

    def check(self) -> None:
        """Refuse bounds that are none, as `besman.records.frozen.Record.check` says."""
        super().check()
        check_rows(self.bounds, "LabelledSegments.bounds")

    def take(self, rows: Sequence[int] | npt.NDArray[np.int64]) -> LabelledSegments:
        """Return some of the segments, in the order of `rows`, shape (K,)."""
        chosen = [int(row) for row in rows]
        return replace(
            self,
            bounds=self.bounds[chosen].reshape(-1, 2),
            labels=tuple(self.labels[row] for row in chosen),
            distances=self.distances[chosen],
            layers=tuple(self.layers[row] for row in chosen) if self.layers else (),
        )


@dataclass(frozen=True, eq=False)
class Actions(Record, stored_as="besman.records:Actions"):
    """What the building blocks of one recording make.

    Attributes
    ----------
    levels : tuple of LabelledSegments
        Actions of each level, the lowest first; those of a level are made of whole ones of the
        level below, and together they cover the recording. ``distances`` are uncertainties.
    fitness : array, shape (L,)
        Minus the mean uncertainty of each level.
    """

    levels: tuple[LabelledSegments, ...]
    fitness: FloatArray

    def __post_init__(self) -> None:
        freeze(self, {"fitness": ("L",)})
        if len(self.levels) != len(self.fitness):
            raise ShapeError(
                f"Actions.levels must have {len(self.fitness)} entries, got {len(self.levels)}"
            )


def check_rows(bounds: npt.NDArray[np.int64], where: str) -> None:
    """Refuse bounds, shape (S, 2), that begin before the first row or end before they begin.

    Raises
    ------
    ShapeError
        Names `where`.
    """
    if np.any(bounds[:, 0] < 0) or np.any(bounds[:, 1] <= bounds[:, 0]):
        raise ShapeError(f"{where} must be half-open rows from 0, each end after its start")
