"""What mapping a class of demonstrations to an arm gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.records import Failure, JointTrajectory, Record, freeze

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Correction(Record, stored_as="besman.mapping.embodiment:Correction"):
    """A demonstration that has a placement of its own.

    Attributes
    ----------
    name : str
    reason : str
        Why the common placement does not serve.
    shift_m, turn_rad : float
        Distance and rotation between the two, in the middle of the movements.
    scale : float
        Factor by which the movement is made smaller or larger, over the common one.
    """

    name: str
    reason: str
    shift_m: float
    turn_rad: float
    scale: float


@dataclass(frozen=True, eq=False)
class Mapping(Record, stored_as="besman.mapping.embodiment:Mapping", finite=("placement",)):
    """All demonstrations of a class in the workspace of one arm.

    Attributes
    ----------
    trajectories : tuple of JointTrajectory
        Those that the arm can run; none violates a limit at 1 kHz.
    placement : array, shape (4, 4)
        Back frame to the robot's world frame, metres.
    failed : tuple of Failure
        Those that it cannot, with the reason.
    terms : dict of float
        Cost terms of the placement.
    limit_violations, self_collisions : int
        Samples at 1 kHz, over all trajectories.
    scale : float
        Factor by which movements were made smaller or larger before.
    corrected : tuple of Correction
        Those of `trajectories` with a placement of their own.
    torque_ratio : float
        Greatest share of a joint's torque limit, over all trajectories at 1 kHz.
    """

    trajectories: tuple[JointTrajectory, ...]
    placement: FloatArray
    failed: tuple[Failure, ...]
    terms: dict[str, float]
    limit_violations: int
    self_collisions: int
    scale: float = 1.0
    corrected: tuple[Correction, ...] = ()
    torque_ratio: float = 0.0

    def __post_init__(self) -> None:
        """Copy the placement, make it read-only and check its shape."""
        freeze(self, {"placement": (4, 4)})
