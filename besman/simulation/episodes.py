"""What goes into a batch of simulated episodes, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Movements:
    """A batch of B movements of one arm, sampled at the simulation's step.

    Attributes
    ----------
    positions, velocities, accelerations : array, shape (B, T, n)
        rad, rad/s, rad/s^2; after its duration a movement stands still.
    durations : array, shape (B,)
        Seconds.
    """

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    durations: FloatArray


@dataclass(frozen=True, eq=False)
class Episodes:
    """What came of B movements.

    Attributes
    ----------
    outcomes : array, shape (B, 3)
        Touchdown of what is thrown, or end position of the tool, metres in the robot's world;
        NaN where there is none.
    end_poses : array, shape (B, 7)
        End pose of the tool centre point: position (m) and quaternion wxyz.
    tracking_errors : array, shape (B,)
        Greatest deviation of a joint from the movement, rad.
    shortfalls : array, shape (B,)
        How far a failed episode was from being none, 0 to 1; 0 where nothing failed.
    failures : tuple of str, length B
        Why an episode failed; "" if it did not.
    object_paths : tuple of arrays, shape (F, 3)
        Paths of what is thrown, metres; empty unless asked for.
    """

    outcomes: FloatArray
    end_poses: FloatArray
    tracking_errors: FloatArray
    shortfalls: FloatArray
    failures: tuple[str, ...]
    object_paths: tuple[FloatArray, ...] = field(default=())
