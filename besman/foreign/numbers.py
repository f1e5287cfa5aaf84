"""Numbers in text: plain decimal ones, as every program writes them.

Python's ``float`` and ``int`` take more: ``1_000``, digits of all scripts, thousands of digits.
"""

from __future__ import annotations

import re

MOST_DIGITS = 15
"""Digits of a whole number: those that a double holds exactly."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]+")


def parse_number(text: str) -> float:
    """Parse a decimal number.

    Parameters
    ----------
    text : str
        ASCII digits with sign, point and exponent; blanks around it are left out.

    Returns
    -------
    float
        Infinite if it is larger than a double can be.

    Raises
    ------
    ValueError
        If it is anything else, also a word such as ``nan``.
    """
    plain = text.strip(" \t\r\n")
    if not _NUMBER.fullmatch(plain):
        raise ValueError(f"{text!r:.60} is no decimal number")
    return float(plain)


def parse_whole_number(text: str) -> int:
    """Parse a whole number of at most `MOST_DIGITS` digits.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    plain = text.strip(" \t\r\n")
    if not _WHOLE.fullmatch(plain) or len(plain.lstrip("+-")) > MOST_DIGITS:
        raise ValueError(f"{text!r:.60} is no whole number of at most {MOST_DIGITS} digits")
    return int(plain)


def has_odd_digits(text: str) -> bool:
    """Tell whether a text with nothing but numbers has some that Python alone takes for numbers."""
    return "_" in text or not text.isascii()
