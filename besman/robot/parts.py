"""What an arm is made of, as frozen arrays: limits, tool, chain of joints and capsules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of n joints.

    Attributes
    ----------
    position_min, position_max : array, shape (n,)
        rad.
    velocity, acceleration, torque : array, shape (n,)
        Greatest absolute values: rad/s, rad/s^2, Nm; all above zero.
    jerk : array, shape (n,)
        The same, rad/s^3; infinite where none is stated.
    """

    position_min: FloatArray
    position_max: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    jerk: FloatArray


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool on the flange.

    Attributes
    ----------
    name : str
    tcp2flange : array, shape (4, 4)
        Pose of the tool centre point (TCP) in the flange's frame, metres. TCP z points where the
        tool points.
    tcp2hand : array, shape (4, 4)
        Pose of the TCP in the person's hand frame, metres: a demonstrated hand pose ``hand2world``
        asks for the TCP pose ``hand2world @ tcp2hand``.
    mass : float
        kg, part of the Pinocchio model's last body.
    capsule_ends : array, shape (2, 3)
        Ends of the axis of the capsule around the tool, in the flange's frame, metres.
    capsule_radius : float
        Metres; 0 for no capsule.
    scale : float
        Factor by which it is shorter than ``tools/NAME.yaml`` has it.
    """

    name: str
    tcp2flange: FloatArray
    tcp2hand: FloatArray
    mass: float
    capsule_ends: FloatArray
    capsule_radius: float
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Chain:
    """The arm as plain arrays for compiled kernels. World: floor below the base, z up.

    Attributes
    ----------
    placements : array, shape (n, 4, 4)
        Pose of each joint's frame in the frame of the joint before it (the first: in the world)
        when all angles are zero, metres.
    axes : array, shape (n, 3)
        Unit rotation axes in the joints' own frames.
    tip : array, shape (4, 4)
        Pose of the TCP in the last joint's frame, metres.
    capsule_joints : int array, shape (C,)
        Joint that moves each capsule; -1 for what stands still.
    capsule_ends : array, shape (C, 2, 3)
        Both ends of each capsule's axis in the frame of its joint (or the world), metres.
    capsule_radii : array, shape (C,)
        Metres.
    capsule_links : tuple of str, length C
        Link that each capsule belongs to.
    capsule_pairs : int array, shape (P, 2)
        Pairs of capsules that must not touch.
    """

    placements: FloatArray
    axes: FloatArray
    tip: FloatArray
    capsule_joints: npt.NDArray[np.int64]
    capsule_ends: FloatArray
    capsule_radii: FloatArray
    capsule_links: tuple[str, ...]
    capsule_pairs: npt.NDArray[np.int64]


def read_only(array: npt.ArrayLike) -> FloatArray:
    """Return a read-only copy as float64."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def capsule_part(links: Sequence[str], index: int) -> str:
    """Return how one capsule of a link is called in ``ignored_pairs``: ``LINK#NUMBER``.

    Parameters
    ----------
    links : sequence of str
        Link of every capsule.
    index : int
        Of the capsule; capsules of a link are counted from 1.
    """
    return f"{links[index]}#{list(links[: index + 1]).count(links[index])}"
