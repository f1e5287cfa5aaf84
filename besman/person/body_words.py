"""Parts of an arm by how labs call their markers: what a name without a marker set tells."""

from __future__ import annotations

import re

from besman.person.marker_set import without_subject
from besman.person.mirror import find_side

# The first that fits counts. Single words are those of public marker sets: Plug-in Gait, ISB,
# OpenSim's Rajagopal, Theia, KIT, Qualisys' sports set.
_PARTS = (
    ("wrist_thumb_side", r"wra$|rad(ius|ial)?$|styl?r$|rsp$|wristin|wrist_?lat|wts$|l_?wrist"),
    ("wrist_little_side", r"wrb$|uln(a|ar)?$|styl?u$|usp$|wristout|wrist_?med|wps$|m_?wrist"),
    ("knuckle", r"fin$|knuckle|mcp|hm2$|hand_?(out|in|end)$|^.?hand$|metacarp"),
    ("wrist", r"wri(st)?$|wjc$"),
    ("elbow", r"elb(ow)?$|epic|ejc$|elbow_?(out|in|lat|med)|[ml]_?elbow|hle$|hme$"),
    ("shoulder", r"sho(ulder)?$|acrom[a-z]*$|acro_?tip$|^[lr]?ac$|sjc$|shoulder_?top"),
)


def guess_part(name: str) -> tuple[str, str]:
    """Guess which part of which arm a marker is on.

    Parameters
    ----------
    name : str
        As a file calls it.

    Returns
    -------
    part : str
        ``shoulder``, ``elbow``, ``wrist``, ``wrist_thumb_side``, ``wrist_little_side`` or
        ``knuckle``; empty if the name tells nothing.
    side : str
        ``left``, ``right``, or empty.
    """
    bare = without_subject(name)
    side = find_side(bare)
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", bare).lower()
    words = re.sub(r"[\s.-]+", "_", words)
    words = re.sub(r"^(left|right)_?|_?(left|right)$", "", words)
    part = next((part for part, pattern in _PARTS if re.search(pattern, words)), "")
    return part, side
