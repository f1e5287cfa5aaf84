"""The mirror image of a recording: a left-handed person becomes a right-handed one."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TypeVar

import numpy as np

from besman.records import FloatArray, LabelledRecording, Recording

Shown = TypeVar("Shown", bound=Recording | LabelledRecording)

MIRROR = np.array([1.0, -1.0, 1.0])
"""What a mirror makes of x, y, z."""

MIRROR_TURN = np.array([1.0, -1.0, 1.0, -1.0])
"""What it makes of a quaternion (w, x, y, z)."""

_SIDES = {"left": "right", "right": "left", "l": "r", "r": "l"}
_WORD = re.compile(r"left|right", re.IGNORECASE)
# RELB, RElbow, rElbow, r_shoulder, r.ASIS; Bip01 R Hand; elbow_r, ASISr; Acclaim's rhumerus.
_LETTER = re.compile(
    r"^[lrLR](?=[ _.-])|^[LRlr](?=[A-Z])|(?<=[ _.-])[lrLR](?=[ _.-]|$)|(?<=[A-Z])[lr]$"
    r"|^[lr](?=(?:clavicle|humerus|radius|wrist|hand|fingers|thumb|hipjoint|femur|tibia|foot|toes)$)"
)


def mirror_name(name: str) -> str:
    """Return the name of the marker on the other side: ``left_elbow`` of ``right_elbow``.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
        The name itself where it has no side.
    """
    pattern = _WORD if _WORD.search(name) else _LETTER
    return pattern.sub(lambda found: _like(found.group(), _SIDES[found.group().lower()]), name)


def mirror_positions(positions: FloatArray) -> FloatArray:
    """Return positions (..., 3) with y turned round."""
    return np.asarray(positions * MIRROR)


def mirror_recording(recording: Shown) -> Shown:
    """Return a recording as a mirror shows it; names stay.

    Parameters
    ----------
    recording : Recording or LabelledRecording
        Metres, z up.

    Returns
    -------
    Recording or LabelledRecording
        y is turned round, in positions and in orientations (their axes too, so that they remain
        rotations).
    """
    positions = mirror_positions(recording.positions)
    orientations = recording.orientations
    if orientations is not None:
        orientations = orientations * MIRROR_TURN
    return replace(recording, positions=positions, orientations=orientations)


def _like(pattern: str, word: str) -> str:
    """Write a word in capitals as another one."""
    if pattern.isupper():
        return word.upper()
    return word.capitalize() if pattern[0].isupper() else word


def find_side(name: str) -> str:
    """Return the side of the body that a name is of: ``left``, ``right``, or empty.

    Parameters
    ----------
    name : str
    """
    bare = name.rpartition(":")[2].strip()
    # "Hand left" is the left one of several on a hand; "left hand" is the left hand.
    found = _WORD.match(bare) or _LETTER.search(bare)
    if found is None:
        return ""
    return "left" if found.group()[0] in "lL" else "right"
