"""What is to be reached: ``box1 on table at x=0.4,y=-0.3; box1 on shelf``, and YAML of the same."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from besman.config.stage import Config
from besman.config.yaml_file import load_config
from besman.exceptions import PlanError, nearest
from besman.foreign.names import fault_of_name
from besman.foreign.numbers import parse_number

_STANDS = re.compile(r"(?P<thing>\S+)\s+on\s+(?P<place>\S+)(?:\s+at\s+(?P<at>.*))?", re.DOTALL)
_KEYS = ("x", "y", "yaw_deg")
_EXPECTED = "expected OBJECT on PLACE, or OBJECT on PLACE at x=METRES,y=METRES[,yaw_deg=DEGREES]"
# A robot's world is no larger.
_FARTHEST_M = 100.0


@dataclass(frozen=True)
class Standing:
    """Where an object stands, or is to stand.

    Attributes
    ----------
    thing : str
        Name of the object: its kind, and maybe a number.
    place : str
        Name of the place.
    at : pair of float, optional
        Where its middle is, metres in the robot's world; anywhere at the place if not given.
    yaw_deg : float, optional
        Where its depth points, from the world's x axis to the left.
    """

    thing: str
    place: str
    at: tuple[float, float] | None = None
    yaw_deg: float | None = None

    def __str__(self) -> str:
        where = "" if self.at is None else f" at x={self.at[0]:g},y={self.at[1]:g}"
        turned = "" if self.yaw_deg is None else f",yaw_deg={self.yaw_deg:g}"
        return f"{self.thing} on {self.place}{where}{turned}"


Goal = tuple[Standing, ...]
"""What is to hold at once."""


class GoalsFile(Config):
    """The content of a YAML file of goals.

    Attributes
    ----------
    start : sequence of str
        Where objects stand, one entry each, as in ``--start``; if none is given the first object
        stands where the first demonstration has it.
    goals : sequence of str
        One after the other, as in ``--goal``.
    """

    start: tuple[str, ...] = ()
    goals: Annotated[tuple[str, ...], Field(min_length=1)]


def read_goals(path: Path) -> tuple[str, str]:
    """Read a YAML file of goals; return start and goals as text.

    Raises
    ------
    ConfigError
        If it is not there, or says something else.
    """
    file = load_config(path, GoalsFile)
    return "; ".join(file.start), "; ".join(file.goals)


def parse_goals(text: str) -> tuple[Goal, ...]:
    """Parse goals.

    Parameters
    ----------
    text : str
        Goals in their order, between semicolons; what is to hold at once is joined by ``and``.

    Raises
    ------
    PlanError
        If there is none, or one says something else.
    """
    parts = [part.strip() for part in text.split(";")]
    if parts[-1:] == [""]:
        parts.pop()
    if not parts:
        raise PlanError(f"no goal: {_EXPECTED}")
    goals = tuple(
        tuple(parse_standing(one) for one in re.split(r"\s+and\s+", part)) for part in parts
    )
    for goal in goals:
        _refuse_twice([one.thing for one in goal], "a goal")
    return goals


def parse_start(text: str) -> tuple[Standing, ...]:
    """Parse where objects stand: as goals, one for each object.

    Raises
    ------
    PlanError
        If an object is there twice, or an entry says something else.
    """
    found = tuple(one for goal in parse_goals(text) for one in goal)
    _refuse_twice([one.thing for one in found], "the start")
    return found


def _refuse_twice(things: Sequence[str], where: str) -> None:
    """Refuse an object that stands twice at once."""
    twice = [thing for thing in things if things.count(thing) > 1]
    if twice:
        raise PlanError(f"{twice[0]} is there twice in {where}: expected each object once")


def parse_standing(text: str) -> Standing:
    """Parse ``OBJECT on PLACE``, maybe with `` at x=..,y=..``; errors as of `parse_goals`."""
    found = _STANDS.fullmatch(text)
    if found is None:
        raise PlanError(f"got {text!r:.80}; {_EXPECTED}")
    for part in (found["thing"], found["place"]):
        fault = fault_of_name(part)
        if fault is not None:
            raise PlanError(f"{part!r:.80} {fault}")
    thing = found["thing"] if found["thing"][-1].isdigit() else f"{found['thing']}1"
    if found["at"] is None:
        return Standing(thing, found["place"])
    values = _parse_values(found["at"], text)
    if not {"x", "y"} <= values.keys():
        raise PlanError(f"{text!r:.80}: expected both x and y, got {', '.join(values)}")
    return Standing(thing, found["place"], (values["x"], values["y"]), values.get("yaw_deg"))


def _parse_values(text: str, where: str) -> dict[str, float]:
    """Parse ``x=0.4,y=-0.3``."""
    values: dict[str, float] = {}
    for part in text.split(","):
        key, equals, number = (one.strip() for one in part.partition("="))
        if not equals or key not in _KEYS:
            raise PlanError(f"{where!r:.80}: got {part.strip()!r:.40}; {nearest(key, _KEYS)}")
        if key in values:
            raise PlanError(f"{where!r:.80}: {key} is there twice")
        try:
            values[key] = parse_number(number)
        except ValueError as error:
            raise PlanError(f"{where!r:.80}: {key}: {error}") from None
        most = 360.0 if key == "yaw_deg" else _FARTHEST_M
        if not abs(values[key]) <= most:
            raise PlanError(f"{where!r:.80}: {key}: got {number}, expected at most {most:g}")
    return values
