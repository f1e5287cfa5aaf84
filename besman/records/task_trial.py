"""What came of a whole task in simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from besman.records.frozen import FloatArray, Record, freeze
from besman.records.whole_tasks import TaskPlan


@dataclass(frozen=True, eq=False)
class TaskTrial(Record, stored_as="TaskTrial", finite=("wanted", "duration")):
    """What came of a `TaskPlan` in simulation.

    Attributes
    ----------
    name : str
        Of the plan.
    success : bool
        Nothing failed, and every object stands where it was to be put.
    failure : str
        What failed; "" if nothing did.
    objects : tuple of str, length O
    wanted : array, shape (O, 7)
        Where each was to be put: position of its middle (m) in the robot's world, quaternion wxyz.
    outcomes : array, shape (O, 7)
        Where it is in the end; NaN if the simulation was unstable.
    misses : array, shape (O,)
        Distance between the two, metres.
    angles : array, shape (O,)
        How much each is turned or tilted against what was wanted, whichever is more, radians.
    duration : float
        Seconds, with the time that the gripper takes.
    """

    name: str
    success: bool
    failure: str
    objects: tuple[str, ...]
    wanted: FloatArray
    outcomes: FloatArray
    misses: FloatArray
    angles: FloatArray
    duration: float

    def __post_init__(self) -> None:
        freeze(
            self,
            {"wanted": ("O", 7), "outcomes": ("O", 7), "misses": ("O",), "angles": ("O",)},
        )

    @property
    def miss(self) -> float:
        """Of the object that is farthest off, metres; NaN if the simulation was unstable."""
        return float(np.max(self.misses, initial=0.0))

    @property
    def angle(self) -> float:
        """Of the object that is turned most, radians; NaN if the simulation was unstable."""
        return float(np.max(self.angles, initial=0.0))


@dataclass(frozen=True, eq=False)
class RefinedTask(Record, stored_as="RefinedTask"):
    """A whole task whose ways to and from its objects were searched until it succeeded.

    Attributes
    ----------
    plan : TaskPlan
        The one that succeeded, or came nearest.
    trial : TaskTrial
        What comes of it.
    tries : int
        Simulations, that of the imitation among them, and those of a block alone.
    """

    plan: TaskPlan
    trial: TaskTrial
    tries: int
