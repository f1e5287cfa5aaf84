"""The valid range of every quantity in a config, by the unit at the end of its key.

A key may be held to less by its own config; never to more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from besman.foreign.names import LONGEST_TEXT, fault_of_characters

SMALLEST = 1e-12
"""Nothing but zero is nearer to zero."""

# Keys of sentences, which may have several lines.
_SENTENCES = ("assumed",)


@dataclass(frozen=True)
class Range:
    """What a quantity may be.

    Attributes
    ----------
    endings : tuple of str
        Ends of the keys that it holds for; the first entry of `RANGES` that fits counts.
    unit : str
    low, high : float
        Least and greatest value.
    reason : str
        What would be beyond.
    """

    endings: tuple[str, ...]
    unit: str
    low: float
    high: float
    reason: str

    @property
    def shown(self) -> str:
        """The endings for a table; all other keys have none of them."""
        return ", ".join(f"``{ending}``" for ending in self.endings if ending) or "anything else"

    @property
    def words(self) -> str:
        """For example ``-1000 to 1000 m``."""
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()


def _within(high: float, unit: str, reason: str, *endings: str, low: float | None = None) -> Range:
    return Range(endings, unit, -high if low is None else low, high, reason)


RANGES = (
    _within(2**32 - 1, "", "more than the random generators take", "seed", low=0),
    _within(1e6, "", "one term that outweighs all others by more than rounding leaves", "_per_m",
            "_per_rad", "_per_finger"),
    _within(1000.0, "m/rad", "an orientation that would weigh more than a room", "_m_rad"),
    _within(57_296.0, "degrees/s", "1000 rad/s", "_deg_s"),
    _within(1e5, "rad/s^2", "ten thousand times gravity at a metre", "_rad_s2"),
    _within(1e8, "rad/s^3", "a thousand times that acceleration, in a second", "_rad_s3"),
    _within(1000.0, "m/s", "three times the speed of sound", "_m_s"),
    _within(57_296.0, "degrees", "1000 rad, or 159 turns", "_deg"),
    _within(1000.0, "rad", "159 turns", "_rad"),
    _within(10_000.0, "Hz", "no system for recording movement", "rate_hz", low=1.0),
    _within(10_000.0, "Hz", "no system for recording movement", "_hz", low=0.01),
    _within(1e6, "kg m^2", "heavier than any arm", "_kgm2", low=0),
    _within(1e4, "kg", "heavier than any arm", "_kg", low=0),
    _within(1e6, "N m s", "stronger than any arm", "_nms"),
    _within(1e6, "N m", "stronger than any arm", "_nm"),
    _within(1e6, "N", "stronger than any arm", "_n"),
    _within(10.0, "m", "wider than any link or tool", "radius_m", low=0),
    _within(100.0, "m", "longer than any link or tool", "ends_m", "translation_m", "_tcp_m",
            "com_m", "height_m"),
    _within(100.0, "rad or m", "16 turns, or longer than any link", "held"),
    _within(1000.0, "m", "no camera sees farther", "_m"),
    _within(1e5, "s", "longer than a day", "_s"),
    _within(1.0, "", "more than all", "_share"),
    _within(1000.0, "", "no unit quaternion, however it was scaled", "_wxyz"),
    _within(1e6, "", "out of all sense, as a count, a weight or a factor", ""),
)  # fmt: skip
"""The range of every key; the last is that of all keys without a unit."""


def range_of(key: str) -> Range:
    """Return the range of a config's key by its ending."""
    return next(one for one in RANGES if key.endswith(one.endings))


def check_values(key: str, value: Any) -> None:
    """Refuse numbers beyond a key's range, and text that a terminal would obey.

    Parameters
    ----------
    key : str
    value : object
        Numbers and texts are looked for in lists and sections, too; other configs look for
        themselves.

    Raises
    ------
    ValueError
    """
    allowed = range_of(key)
    for one in _leaves(value):
        if isinstance(one, str):
            if len(one) > LONGEST_TEXT:
                raise ValueError(f"{len(one)} characters, expected at most {LONGEST_TEXT}")
            text = one.replace("\n", " ") if key in _SENTENCES else one
            fault = fault_of_characters(text)
            if fault is not None:
                raise ValueError(f"{one!r:.60} {fault}")
        elif not allowed.low <= one <= allowed.high or 0 < abs(one) < SMALLEST:
            raise ValueError(f"expected {allowed.words}")


def _leaves(value: Any) -> Iterator[float | str]:
    """Yield the numbers and texts in a value."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float | str):
        yield value
    elif isinstance(value, dict):
        yield from (str(key) for key in value)
        for inner in value.values():
            yield from _leaves(inner)
    elif isinstance(value, tuple | list):
        for inner in value:
            yield from _leaves(inner)
