"""A whole action of a person: its blocks, the hand's way through all of them, and its objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from besman.records.frozen import FloatArray, Record, ShapeError, freeze
from besman.records.trajectories import HandTrajectory


@dataclass(frozen=True, eq=False)
class BlockDemonstration(
    Record, stored_as="BlockDemonstration", finite=("bounds_s", "holds_s", "object_positions")
):
    """One demonstration of an action that is a sequence of blocks.

    Attributes
    ----------
    hand : HandTrajectory
        Over all of it, its rests included; its ``label`` is the action.
    labels : tuple of str, length B
        Blocks in the order of time.
    bounds_s : array, shape (B, 2)
        Start and end of each block, seconds on the clock of `hand`; rests may lie between them.
    objects : tuple of str, length O
    object_positions : array, shape (T, O, 3)
        Centroid of the markers of each object, metres in the back frame of `hand`.
    object_headings : array, shape (T, O)
        How an object is turned about the vertical: direction from its first to its last marker,
        radians from the back frame's x axis, without jumps; NaN with one marker.
    holds_s : array, shape (H, 2)
        When an object begins and ceases to move with the hand, seconds.
    held : tuple of str, length H
        Which object.
    opening_m : array, shape (T,)
        Distance between thumb and the other fingers, metres; NaN where they are not seen.
    """

    hand: HandTrajectory
    labels: tuple[str, ...]
    bounds_s: FloatArray
    objects: tuple[str, ...]
    object_positions: FloatArray
    object_headings: FloatArray
    holds_s: FloatArray
    held: tuple[str, ...]
    opening_m: FloatArray

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "bounds_s": ("B", 2),
                "object_positions": ("T", "O", 3),
                "object_headings": ("T", "O"),
                "holds_s": ("H", 2),
                "opening_m": ("T",),
            },
        )
        lengths = {
            "labels": len(self.bounds_s),
            "objects": self.object_positions.shape[1],
            "held": len(self.holds_s),
        }
        for name, expected in lengths.items():
            if len(getattr(self, name)) != expected:
                raise ShapeError(
                    f"BlockDemonstration.{name} must have {expected} entries, got "
                    f"{len(getattr(self, name))}"
                )
        if len(self.hand.time) != len(self.opening_m):
            raise ShapeError(
                f"BlockDemonstration.opening_m must have shape ({len(self.hand.time)}), got "
                f"{self.opening_m.shape}"
            )

    @property
    def name(self) -> str:
        """Name of the demonstration, unique within a run."""
        return self.hand.name

    def block_at(self, time_s: float) -> int:
        """Return the block that goes on at a time; during a rest the nearer one."""
        away = np.maximum(self.bounds_s[:, 0] - time_s, time_s - self.bounds_s[:, 1])
        return int(np.argmin(np.maximum(away, 0.0)))
