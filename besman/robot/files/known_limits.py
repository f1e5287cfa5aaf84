"""What makers publish of their arms' limits, for files that do not say: ``known_limits.yaml``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Annotated
from xml.etree import ElementTree

from pydantic import Field, field_validator, model_validator

from besman.config.resources import resource_folder
from besman.config.stage import Config
from besman.config.yaml_file import load_config

_FILE = "known_limits.yaml"
_WORD = re.compile(r"[a-z0-9]+")
_KEYS = ("velocity_deg_s", "acceleration_rad_s2", "torque_nm")

Values = tuple[Annotated[float, Field(gt=0)], ...]


class KnownArm(Config):
    """Published limits of one arm.

    Attributes
    ----------
    arm : str
        Maker and model.
    names : tuple of str
        What the arm is called in files, in lower case letters and digits: one word, or several in
        a row, of the robot's or the file's name.
    velocity_deg_s, acceleration_rad_s2, torque_nm : tuple of float, optional
        Of every joint from base to tip: degrees/s, rad/s^2, Nm.
    source : str
        Where they are published.
    reach_m, reach_source : float, str, optional
        How far it reaches from its first axis, to the flange or to the wrist as its maker counts,
        metres, and where that is published.
    """

    arm: str
    names: Annotated[tuple[str, ...], Field(min_length=1)]
    velocity_deg_s: Values | None = None
    acceleration_rad_s2: Values | None = None
    torque_nm: Values | None = None
    source: str
    reach_m: Annotated[float, Field(gt=0)] | None = None
    reach_source: str | None = None

    @field_validator("names")
    @classmethod
    def _check_names(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        """Refuse names that no file's name could be compared with."""
        for name in names:
            if not _WORD.fullmatch(name):
                raise ValueError(f"got {name!r}, expected lower case letters and digits")
        return names

    @model_validator(mode="after")
    def _check_lengths(self) -> KnownArm:
        """Refuse figures of different numbers of joints."""
        if len({len(values) for values in self.limits.values()}) != 1:
            raise ValueError("expected figures, all of the same number of joints")
        if (self.reach_m is None) != (self.reach_source is None):
            raise ValueError("expected reach_m and reach_source, or neither")
        return self

    @property
    def limits(self) -> dict[str, Values]:
        """The figures that are there, by name."""
        named = {key: getattr(self, key) for key in _KEYS}
        return {key: values for key, values in named.items() if values is not None}

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(next(iter(self.limits.values())))


class KnownLimits(Config):
    """The whole file.

    Attributes
    ----------
    arms : dict of KnownArm
        By a short name that is used nowhere else.
    """

    arms: dict[str, KnownArm]


@lru_cache(maxsize=1)
def known_arms() -> Mapping[str, KnownArm]:
    """Return all arms of ``robots/known_limits.yaml``."""
    return load_config(resource_folder("robots") / _FILE, KnownLimits).arms


def arm_titles(tree: ElementTree.Element, names: Sequence[str]) -> list[str]:
    """Return what an arm may be called by: its description's name, some others, its first joint's.

    Parameters
    ----------
    tree : Element
        The URDF.
    names : sequence of str
        Of its files.
    """
    first = [str(joint.get("name")) for joint in tree.findall("joint")][:1]
    return [str(tree.get("name", "")), *names, *first]


def find_known_arm(titles: Sequence[str], n: int) -> KnownArm | None:
    """Find an arm by what it is called.

    Parameters
    ----------
    titles : sequence of str
        Names of robot, file and folders, those that count most first.
    n : int
        Number of its joints.

    Returns
    -------
    KnownArm or None
        That of the first title that names just one with so many joints.
    """
    for title in titles:
        words = _WORD.findall(title.lower())
        runs = {
            "".join(words[first:last])
            for first in range(len(words))
            for last in range(first + 1, len(words) + 1)
        }
        found = [arm for arm in known_arms().values() if arm.n == n and runs & set(arm.names)]
        if len(found) == 1:
            return found[0]
    return None
