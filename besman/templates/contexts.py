"""Contexts of tasks: what differs from one occasion to the next, and how a motion plan is told."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError, nearest
from besman.foreign.numbers import parse_number
from besman.geometry.quaternions import from_rotation_vector, multiply
from besman.records import AnyPlan
from besman.records.recordings import FARTHEST_M
from besman.simulation.task import PlacedBy, Task

FloatArray = npt.NDArray[np.float64]

Plan = TypeVar("Plan", bound=AnyPlan)


class ContextKind(ABC):
    """The context of one kind of task; a unit other than metres ends a name.

    Attributes
    ----------
    allowed, usual : tuple of str
        Coordinates that may be chosen, and those that are if none are.
    margins : dict of float
        How far beyond the run's own contexts is learnt, unless a region is given.
    """

    allowed: ClassVar[tuple[str, ...]]
    usual: ClassVar[tuple[str, ...]]
    margins: ClassVar[dict[str, float]]

    @abstractmethod
    def of(self, plan: AnyPlan, names: Sequence[str]) -> FloatArray:
        """Return the context that a plan was made for, shape (S,)."""

    @abstractmethod
    def place(self, plan: Plan, names: Sequence[str], context: npt.ArrayLike) -> Plan:
        """Return the plan for a context (S,); its movement stays."""

    def choose(self, names: Sequence[str]) -> tuple[str, ...]:
        """Check names of coordinates; without any, return the usual ones.

        Raises
        ------
        RefinementError
            If a name is unknown or there twice.
        """
        for name in names:
            if name not in self.allowed:
                raise RefinementError(f"context: got {name!r}; {nearest(name, self.allowed)}")
            if list(names).count(name) > 1:
                raise RefinementError(f"context: got {name!r} twice; expected it once")
        return tuple(names) or self.usual


class TargetContext(ContextKind):
    """Where something is to come, on the floor as a rule: x and y in the robot's world, metres."""

    allowed = ("x", "y")
    usual = ("x", "y")
    margins: ClassVar[dict[str, float]] = {"x": 0.4, "y": 0.4}

    def of(self, plan: AnyPlan, names: Sequence[str]) -> FloatArray:
        """Return the coordinates of the plan's target."""
        return np.array([plan.target["xy".index(name)] for name in names])

    def place(self, plan: Plan, names: Sequence[str], context: npt.ArrayLike) -> Plan:
        """Return the plan with another target."""
        target = plan.target.copy()
        for name, value in zip(names, np.asarray(context, dtype=np.float64), strict=True):
            target["xy".index(name)] = value
        return replace(plan, target=target)


class ObjectContext(ContextKind):
    """Where the thing that is reached for stands, and with it what it stands on.

    x, y and z in the robot's world, metres, and how far it is turned to the left about the
    vertical, degrees, against the demonstrated pose.

    Parameters
    ----------
    poses : tuple of str
        Fields of a plan; the first is where the thing stands, the others are moved with it.
    """

    allowed = ("x", "y", "z", "turn_deg")
    usual = ("x", "y")
    margins: ClassVar[dict[str, float]] = {"x": 0.05, "y": 0.05, "z": 0.05, "turn_deg": 15.0}

    def __init__(self, poses: Sequence[PlacedBy] = ("goal_pose",)) -> None:
        self._poses = tuple(poses)

    def of(self, plan: AnyPlan, names: Sequence[str]) -> FloatArray:
        """Return the coordinates of the pose that counts."""
        at = getattr(plan, self._poses[0])
        values = dict(zip("xyz", at[:3], strict=True)) | {"turn_deg": 0.0}
        return np.array([values[name] for name in names])

    def place(self, plan: Plan, names: Sequence[str], context: npt.ArrayLike) -> Plan:
        """Return the plan with its poses moved and turned together."""
        before = getattr(plan, self._poses[0])[:3]
        after, angle = before.copy(), 0.0
        for name, value in zip(names, np.asarray(context, dtype=np.float64), strict=True):
            if name == "turn_deg":
                angle = np.radians(value)
            else:
                after["xyz".index(name)] = value
        turn = from_rotation_vector(np.array([0.0, 0.0, angle]))
        level = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        moved: dict[str, Any] = {}
        for field in self._poses:
            pose = getattr(plan, field).copy()
            pose[:2] = level @ (pose[:2] - before[:2]) + after[:2]
            pose[2] += after[2] - before[2]
            moved[field] = np.concatenate([pose[:3], multiply(turn, pose[3:])])
        return replace(plan, **moved)


def context_kind(task: Task) -> ContextKind:
    """Return what the context of a task is: where that stands which its plans are placed by.

    Raises
    ------
    RefinementError
        If the task's things stand at a fixed place.
    """
    if task.fixed_by:
        raise RefinementError(
            f"task {task.kind}: {task.fixed_by} fixes where its things are; expected null, so that "
            "they are where the context says"
        )
    return TargetContext() if task.placed_by == ("target",) else ObjectContext(task.placed_by)


def parse_names(text: str | None) -> tuple[str, ...]:
    """Split names of coordinates at commas: ``x,y``."""
    return tuple(name.strip() for name in text.split(",")) if text else ()


def parse_context(text: str, names: Sequence[str]) -> FloatArray:
    """Read ``x=2.3,y=0.4``.

    Parameters
    ----------
    text : str
    names : sequence of str
        The coordinates that a context has.

    Returns
    -------
    array, shape (S,)
        In the order of the names.

    Raises
    ------
    RefinementError
        If a coordinate is missing, unknown, there twice or not a finite number.
    """
    values = {key: _number(key, value) for key, value in _pairs(text, names, "--context").items()}
    missing = [name for name in names if name not in values]
    if missing:
        raise RefinementError(
            f"--context: got {text!r}, {', '.join(missing)} missing; expected "
            + ",".join(f"{name}=NUMBER" for name in names)
        )
    return np.array([values[name] for name in names])


def parse_region(text: str, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Read ``x=0.8:1.8,y=0.2:1.2``: least and greatest value of some coordinates.

    Raises
    ------
    RefinementError
        If a coordinate is unknown, there twice, or its values are not two rising numbers.
    """
    region = {}
    for key, value in _pairs(text, names, "--region").items():
        parts = value.split(":")
        ends = [_number(key, part, "--region") for part in parts]
        if len(ends) != 2 or not ends[0] < ends[1]:
            raise RefinementError(
                f"--region: {key}: got {value!r}, expected LEAST:GREATEST, e.g. {key}=0.8:1.8"
            )
        region[key] = (ends[0], ends[1])
    return region


def _pairs(text: str, names: Sequence[str], option: str) -> dict[str, str]:
    """Split ``a=1,b=2``."""
    pairs: dict[str, str] = {}
    for part in text.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise RefinementError(f"{option}: got {part.strip()!r}, expected NAME=VALUE")
        if key not in names:
            raise RefinementError(f"{option}: got {key!r}; {nearest(key, names)}")
        if key in pairs:
            raise RefinementError(f"{option}: got {key!r} twice; expected it once")
        pairs[key] = value
    return pairs


def _number(key: str, text: str, option: str = "--context") -> float:
    """Read one number that may be a place or an angle."""
    try:
        value = parse_number(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= FARTHEST_M:
        raise RefinementError(
            f"{option}: {key}: got {text!r:.60}, expected a number of at most {FARTHEST_M:g}"
        )
    return value
