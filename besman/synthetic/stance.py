"""Where a simulated person stands, and the random numbers of one part of a capture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Stance:
    """Where a person stands and how the body sways.

    Attributes
    ----------
    heading : Rotation
        Turn about the vertical from the person's axes to the laboratory's.
    place : array, shape (3,)
        Point on the floor between the feet, metres in the laboratory frame.
    sway_m, sway_hz, sway_phase : array, shape (2, 3)
        Two waves along each axis: metres, hertz, rad.
    """

    heading: Rotation
    place: FloatArray
    sway_m: FloatArray
    sway_hz: FloatArray
    sway_phase: FloatArray

    def sway(self, time: FloatArray) -> FloatArray:
        """How far the body is off its place, shape (T, 3), metres in the person's axes."""
        waves = np.sin(2.0 * np.pi * self.sway_hz * time[:, None, None] + self.sway_phase)
        offset: FloatArray = (waves * self.sway_m).sum(axis=1)
        return offset


def draw_stance(rng: np.random.Generator) -> Stance:
    """Draw where a person stands: anywhere in the middle of the laboratory, facing roughly +x."""
    return Stance(
        heading=Rotation.from_euler("Z", rng.uniform(-30.0, 30.0), degrees=True),
        place=np.array([*rng.uniform(-0.6, 0.6, 2), 0.0]),
        sway_m=rng.uniform(0.001, 0.004, (2, 3)) * np.array([1.0, 1.0, 0.1]),
        sway_hz=rng.uniform([[0.10], [0.25]], [[0.25], [0.45]], (2, 3)),
        sway_phase=rng.uniform(0.0, 2.0 * np.pi, (2, 3)),
    )


def stream(seed: int, *key: int) -> np.random.Generator:
    """Random numbers of one part of a capture, independent of those of every other key."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
