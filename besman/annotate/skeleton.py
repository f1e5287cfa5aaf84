"""Which markers a stick figure joins by lines."""

from __future__ import annotations

from collections.abc import Sequence

from besman.person.marker_set import normalise_name

_BACK = ("back_top", "back_left", "back_right")
_ARM = (
    ("back_top", "shoulder"),
    ("shoulder", "elbow"),
    ("elbow", "hand_left"),
    ("elbow", "hand_right"),
    ("hand_left", "hand_right"),
    ("hand_left", "hand_top"),
    ("hand_right", "hand_top"),
    ("hand_top", "thumb"),
    ("hand_top", "index"),
    ("hand_top", "middle"),
)
_SUIT = (
    ("pelvis", "l5"),
    ("l5", "l3"),
    ("l3", "t12"),
    ("t12", "t8"),
    ("t8", "neck"),
    ("neck", "head"),
    *(
        (f"{side}_{a}" if a != "t8" else a, f"{side}_{b}")
        for side in ("right", "left")
        for a, b in (
            ("t8", "shoulder"),
            ("shoulder", "upper_arm"),
            ("upper_arm", "fore_arm"),
            ("fore_arm", "hand"),
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
        )
    ),
)
_OBJECTS = (("box_back", "box_left"),)


def find_bones(names: Sequence[str | None]) -> list[tuple[int, int]]:
    """Return pairs of trajectories to join.

    Parameters
    ----------
    names : sequence of str or None
        Names as in the file; case, spaces, underscores and hyphens do not matter.

    Returns
    -------
    list of pair of int
        Indices into `names`.
    """
    index = {normalise_name(name): k for k, name in enumerate(names) if name}
    pairs = [*zip(_BACK, (*_BACK[1:], _BACK[0]), strict=True), *_SUIT, *_OBJECTS]
    for side in ("", "right_", "left_"):
        for a, b in _ARM:
            back = a in _BACK and normalise_name(a) in index
            pairs.append((a if back else side + a, side + b))
    found = []
    for a, b in pairs:
        one, other = index.get(normalise_name(a)), index.get(normalise_name(b))
        if one is not None and other is not None:
            found.append((min(one, other), max(one, other)))
    return sorted(set(found))
