"""What a log holds, in whatever format: markers, movements and events on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from besman.records import FloatArray


@dataclass(frozen=True, eq=False)
class LoggedMarkers:
    """A person's markers: ``visualization_msgs/MarkerArray``, a marker's name is its namespace.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds on the log's clock.
    positions : array, shape (T, M, 3)
        Metres in the laboratory frame; NaN where a marker was not seen: it is deleted there.
    names : tuple of str or None, length M
    """

    time: FloatArray
    positions: FloatArray
    names: tuple[str | None, ...]


@dataclass(frozen=True, eq=False)
class LoggedMovement:
    """A movement of an arm: trajectory, joint states and transforms.

    Attributes
    ----------
    start_s : float
        Seconds on the log's clock.
    trajectory : tuple of four arrays
        Time (T,), positions, velocities, accelerations (T, n): s, rad, rad/s, rad/s^2.
    joint_names : tuple of str, length n
    rows : int array, shape (R,)
        Samples that are joint states and transforms too.
    frames : tuple of str, length F
    poses : array, shape (R, F, 7)
        Their position (m) and quaternion (x, y, z, w) in the robot's world frame.
    """

    start_s: float
    trajectory: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    joint_names: tuple[str, ...]
    rows: npt.NDArray[np.int64]
    frames: tuple[str, ...]
    poses: FloatArray


@dataclass(frozen=True)
class LoggedEvent:
    """Something that begins: ``rcl_interfaces/Log``.

    Attributes
    ----------
    time_s : float
        On the log's clock.
    label : str
    kind : str
        ``block`` of a person, or ``motion`` of an arm.
    source : str
        Recording or motion that it is of.
    index : int
        Which of its blocks, from 0.
    """

    time_s: float
    label: str
    kind: str
    source: str
    index: int


@dataclass(frozen=True)
class Log:
    """What is logged; `movements` by the prefix of their topics and frames, "" of the only arm."""

    markers: Sequence[LoggedMarkers] = ()
    movements: dict[str, Sequence[LoggedMovement]] = field(default_factory=dict)
    events: Sequence[LoggedEvent] = ()
