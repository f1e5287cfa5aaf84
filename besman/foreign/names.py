"""Names from files: what a terminal, a table or a second line would obey is none."""

from __future__ import annotations

import re
import unicodedata

LONGEST = 200
"""Characters of a name."""

LONGEST_TEXT = 4096
"""Characters of any text that is no sentence; no path is longer."""

# What systems put before a marker's name without a colon: ``Skeleton_001_Hip``.
_SUBJECT = re.compile(r"(?i)^(skeleton|subject|person|actor)[ _]?\d+(?=[ _])")

# Control characters, halves of a character, line and paragraph ends.
_REFUSED = {"Cc", "Cs", "Zl", "Zp"}
_TURNS_TEXT = {*"\u200e\u200f\u061c", *map(chr, (*range(0x202A, 0x202F), *range(0x2066, 0x206A)))}


def fault_of_name(name: str) -> str | None:
    """Say what is wrong with a name from a file.

    Parameters
    ----------
    name : str
        Of a marker, joint, segment, class.

    Returns
    -------
    str or None
        For example ``has the control character U+001B``; None if nothing is.
    """
    if len(name) > LONGEST:
        return f"has {len(name)} characters, more than {LONGEST}"
    return fault_of_characters(name)


def fault_of_characters(text: str) -> str | None:
    """Say which control character a text has, None if none; it may be of any length."""
    if text.isprintable():
        return None
    for one in text:
        if unicodedata.category(one) in _REFUSED or one in _TURNS_TEXT:
            return f"has the control character U+{ord(one):04X}"
    return None


def fault_of_part_name(name: str) -> str | None:
    """Say what is wrong with the name of a joint, link or tool, None if nothing is.

    It names columns of tables and bodies in other programs, so that it is not empty and begins like
    no formula.
    """
    if not name.strip():
        return "is empty"
    if name[0] in "=+-@":
        return f"begins with {name[0]!r}, as a formula of a spreadsheet does"
    return fault_of_name(name)


def split_subject(name: str) -> tuple[str, str]:
    """Split a name from the person or thing it belongs to: ``Ann:RELB``, ``Skeleton_001_Hip``.

    Parameters
    ----------
    name : str

    Returns
    -------
    subject : str
        What stands before the last colon, ``Ann``; empty if nothing does.
    bare : str
        What is left, ``RELB``.
    """
    before, _, bare = name.rpartition(":")
    bare = bare.strip()
    found = _SUBJECT.match(bare)
    if found is None:
        return before.strip(), bare
    return before.strip() or found[0], bare[found.end() + 1 :]
