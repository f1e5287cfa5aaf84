"""What goes into a batch of simulated episodes, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.simulation.perturbation import Perturbation

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Movements:
    """A batch of B movements of one arm, sampled at the simulation's step.

    Attributes
    ----------
    positions, velocities, accelerations : array, shape (B, T, n)
        rad, rad/s, rad/s^2; after its duration a movement stands still.
    durations : array, shape (B,)
        Seconds that the motion plans take.
    ends : array, shape (B,), optional
        Seconds until the task's own part after them is over; NaN where the arm cannot do it.
    perturbations : tuple of Perturbation, length B
        How the world differs from its model in each; empty if it does not.
    """

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    durations: FloatArray
    ends: FloatArray | None = None
    perturbations: tuple[Perturbation, ...] = ()

    @property
    def distinct(self) -> Movements:
        """The first alone, if all are that one, see `repeat_movement`; else all of them."""
        if len(self.positions) < 2 or self.positions.strides[0]:
            return self
        return Movements(
            positions=self.positions[:1],
            velocities=self.velocities[:1],
            accelerations=self.accelerations[:1],
            durations=self.durations[:1],
            ends=None if self.ends is None else self.ends[:1],
        )


def repeat_movement(movement: Movements, n: int) -> Movements:
    """Return a batch of n times the same movement, which is kept once; read-only."""

    def repeat(part: FloatArray) -> FloatArray:
        return np.broadcast_to(part[0], (n, *part.shape[1:]))

    return Movements(
        positions=repeat(movement.positions),
        velocities=repeat(movement.velocities),
        accelerations=repeat(movement.accelerations),
        durations=repeat(movement.durations),
        ends=None if movement.ends is None else repeat(movement.ends),
    )


@dataclass(frozen=True, eq=False)
class Playback:
    """One episode as it can be looked at.

    Attributes
    ----------
    model : mujoco.MjModel
        The scene; the arm's joints come first.
    states : array, shape (F, nq)
        Positions of all its joints after each of the task's time steps, rad or metres and
        quaternions wxyz, until nothing happens any more.
    """

    model: mujoco.MjModel
    states: FloatArray


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
        Paths of what is thrown or carried, metres; empty unless asked for.
    measures : dict of arrays, shape (B,)
        What else an episode is judged by, the unit at the end of each name.
    releases : array, shape (B, 6), optional
        Position (m) and velocity (m/s) with which what is thrown is clear; NaN if it never is.
    playbacks : tuple of Playback
        What is seen of each; empty unless paths are asked for.
    """

    outcomes: FloatArray
    end_poses: FloatArray
    tracking_errors: FloatArray
    shortfalls: FloatArray
    failures: tuple[str, ...]
    object_paths: tuple[FloatArray, ...] = field(default=())
    measures: dict[str, FloatArray] = field(default_factory=dict)
    releases: FloatArray | None = None
    playbacks: tuple[Playback, ...] = ()


def tracking_errors(
    positions: FloatArray, movements: Movements, last: npt.NDArray[np.int64]
) -> FloatArray:
    """Compute how far arms were off their movements.

    Parameters
    ----------
    positions : array, shape (B, T, n)
        Joint angles after each step, rad.
    movements : Movements
        What was asked for.
    last : int array, shape (B,)
        Last step that counts.

    Returns
    -------
    array, shape (B,)
        Greatest deviation of a joint, rad; infinite where a simulation diverged before.
    """
    # States are those after a step; none after the last that counts is looked at.
    asked, steps = movements.positions, min(int(last.max()) + 1, positions.shape[1])
    wanted = np.concatenate([asked[:, 1 : steps + 1], asked[:, -1:]], axis=1)[:, :steps]
    # Joint by joint: over so short an axis a maximum takes ten times as long.
    deviation = np.abs(positions[:, :steps, 0] - wanted[:, :, 0])
    for joint in range(1, positions.shape[2]):
        away = np.abs(positions[:, :steps, joint] - wanted[:, :, joint])
        np.maximum(deviation, away, out=deviation)
    deviation[np.isnan(deviation)] = np.inf
    during = np.arange(steps) <= last[:, None]
    return np.asarray(np.where(during, deviation, 0.0).max(axis=1))


def arm_failure(tracking: float, greatest: float) -> str:
    """Name what an arm did wrong: "" if it was within `greatest` (rad) of its movement."""
    if not np.isfinite(tracking):
        return "unstable simulation"
    return "arm did not follow" if tracking > greatest else ""


def lag_shortfall(tracking: float, greatest: float) -> float:
    """Return how far an arm that did not follow was from following, 0 to 1.

    The share of its deviation that is too much: without it a search cannot tell an arm that nearly
    follows from one that is stuck.
    """
    return float(np.clip(1.0 - greatest / tracking, 0.0, 1.0)) if np.isfinite(tracking) else 1.0
