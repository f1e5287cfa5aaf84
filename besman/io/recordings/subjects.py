"""One of several people or things in a recording, by what stands before trajectories' names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError, nearest
from besman.foreign.names import split_subject
from besman.records import Recording
from besman.records.frozen import hand_over


def find_subjects(names: Sequence[str | None]) -> tuple[str, ...]:
    """Return whose the trajectories are: ``Ann`` of ``Ann:RELB``; in the order of the file.

    Parameters
    ----------
    names : sequence of str or None
        Names as written in the file.
    """
    owners = (split_subject(name)[0] for name in names if name)
    return tuple(dict.fromkeys(owner for owner in owners if owner))


def take_subject(recording: Recording, asked: str | None, path: Path) -> Recording:
    """Return a recording without what belongs to another subject than the one asked for.

    Parameters
    ----------
    recording : Recording
    asked : str or None
        Capital and small letters are alike. All are taken if None.
    path : Path
        Named in errors.

    Returns
    -------
    Recording
        What belongs to nobody, such as a ball and trajectories without a name, stays.

    Raises
    ------
    RecordingError
        If there is no such subject; the message lists those there are.
    """
    if asked is None:
        return recording
    subjects = find_subjects(recording.names)
    wanted = asked.strip().lower()
    if wanted not in {one.lower() for one in subjects}:
        raise RecordingError(f"{path}: no subject {asked!r:.60}; {nearest(asked, subjects)}")
    owners = [split_subject(name)[0].lower() if name else "" for name in recording.names]
    kept = np.flatnonzero([owner in ("", wanted) for owner in owners])
    turned = recording.orientations
    return replace(
        recording,
        positions=hand_over(np.ascontiguousarray(recording.positions[:, kept])),
        names=tuple(recording.names[column] for column in kept),
        orientations=None if turned is None else turned[:, kept],
    )
