"""Names of the points of a C3D file, out of labels that were cut, doubled or left empty."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from besman.io.warning import warn_of_file
from besman.records import FloatArray

_UNNAMED = re.compile(r"\*\d*")
_MARKS = re.compile(r"[^a-z0-9]")
# Labels of programs that give them no more room; the descriptions have the whole name.
_CUT_AT = 4
_MOST_NAMED = 4


def find_names(
    labels: Sequence[str], descriptions: Sequence[str], positions: FloatArray, source: str
) -> tuple[str | None, ...]:
    """Turn labels into names.

    Parameters
    ----------
    labels, descriptions : sequence of str
        Of each point; a description may be empty.
    positions : array, shape (T, M, 3)
        NaN where not seen.
    source : str
        The file's name, for messages.

    Returns
    -------
    tuple of str or None
        None for unnamed points (``*0``, ``*1``, ...). The prefix of names such as ``subject:LASI``
        is left out if there is only one. Descriptions are the names where labels are their first
        four letters, or are not told apart.

    Warns
    -----
    RecordingWarning
        If several points have one name: the only one of them that is seen keeps it, otherwise none.
    """
    if _are_cut(labels, descriptions):
        labels = descriptions
    prefixes = {label.split(":", 1)[0] for label in labels if ":" in label}
    bare = [label.split(":", 1)[-1].strip() if len(prefixes) == 1 else label for label in labels]
    names = [None if not name or _UNNAMED.fullmatch(name) else name for name in bare]
    return keep_single_names(names, positions, source, "points")


def keep_single_names(
    names: Sequence[str | None], positions: FloatArray, source: str, what: str
) -> tuple[str | None, ...]:
    """Take names away that several trajectories have: nobody knows whose they are.

    Parameters
    ----------
    names : sequence of str or None
    positions : array, shape (T, M, 3)
        NaN where not seen.
    source, what : str
        The file's name and what has the names, for the warning.

    Warns
    -----
    RecordingWarning
        With the names, where that was so; the only one of them that is ever seen keeps its name.
    """
    counts = Counter(name for name in names if name)
    doubled = [name for name, count in counts.items() if count > 1]
    if not doubled:
        return tuple(names)
    seen = np.asarray(np.asarray(np.isfinite(positions).all(axis=2)).any(axis=0))
    found: list[str | None] = list(names)
    for name in doubled:
        places = [index for index, other in enumerate(names) if other == name]
        alive = [index for index in places if seen[index]]
        for index in places:
            if alive != [index]:
                found[index] = None
    unclear = [name for name in doubled if name not in found]
    if unclear:
        listed = ", ".join(f"{name!r:.60} ({counts[name]})" for name in unclear[:_MOST_NAMED])
        more = f" and {len(unclear) - _MOST_NAMED} more" if len(unclear) > _MOST_NAMED else ""
        warn_of_file(f"{source}: several {what} have one name and are left without: {listed}{more}")
    return tuple(found)


def _are_cut(labels: Sequence[str], descriptions: Sequence[str]) -> bool:
    """Tell whether descriptions are the names that labels are cut or doubled of."""
    pairs = [
        (_MARKS.sub("", label.lower()), _MARKS.sub("", description.lower()))
        for label, description in zip(labels, descriptions, strict=True)
        if label and not _UNNAMED.fullmatch(label)
    ]
    whole = [description for _, description in pairs]
    if not pairs or not all(whole) or len(set(whole)) < len(whole):
        return False
    if len({label for label, _ in pairs}) < len(pairs):
        return True
    begins = all(len(label) <= _CUT_AT and long.startswith(label) for label, long in pairs)
    return begins and any(len(long) > len(label) for label, long in pairs)
