"""The pipeline's first step: recordings and, where there are any, their manual segments."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import RecordingError
from besman.io.recordings.formats import find_companions, find_recordings, read_recording
from besman.io.recordings.true_names import find_true_names, read_true_names
from besman.io.segments_json import find_segments, read_segments
from besman.records import LabelledSegments, Recording


@dataclass(frozen=True)
class Inputs:
    """What was read.

    Attributes
    ----------
    recordings : tuple of Recording
    truth : tuple of LabelledSegments or None
        Manual segments of each recording, None where there are none.
    names : tuple of (tuple of str or None)
        For each recording the true marker of each trajectory, None where that is not known.
    teacher : Recording, optional
        The recording that markers are learnt from.
    checksums : dict of str
        SHA-256 of every file by its name; of the URDF of a joint log too, by both names where logs
        of two folders have different ones of one name.
    """

    recordings: tuple[Recording, ...]
    truth: tuple[LabelledSegments | None, ...]
    names: tuple[tuple[str, ...] | None, ...]
    teacher: Recording | None
    checksums: dict[str, str]


def read_inputs(paths: Sequence[str], teacher: str | None = None) -> Inputs:
    """Read recordings, and the segments and truth files beside them.

    Parameters
    ----------
    paths : sequence of str
        Files or folders.
    teacher : str, optional
        Recording that markers are learnt from.

    Returns
    -------
    Inputs

    Raises
    ------
    RecordingError
        If a file is missing or damaged, or two recordings have one name.
    """
    files = find_recordings([Path(path) for path in paths])
    twice = [name for name, count in Counter(file.name for file in files).items() if count > 1]
    if twice:
        folders = ", ".join(str(file.parent) for file in files if file.name == twice[0])
        raise RecordingError(f"{twice[0]}: two recordings have this name, in {folders}")
    recordings, truth, names = [], [], []
    checksums: dict[str, str] = {}
    for file in files:
        recording = read_recording(file)
        segments = find_segments(file)
        recordings.append(recording)
        truth.append(None if segments is None else read_segments(segments, recording))
        names_file = find_true_names(file)
        names.append(None if names_file is None else read_true_names(names_file, recording))
        beside = (path for path in (segments, names_file) if path is not None)
        _note_checksums(checksums, file, *beside, *find_companions(file))
    learnt = None
    if teacher is not None:
        learnt = read_recording(Path(teacher))
        _note_checksums(checksums, Path(teacher), *find_companions(Path(teacher)))
    return Inputs(tuple(recordings), tuple(truth), tuple(names), learnt, checksums)


def _note_checksums(checksums: dict[str, str], recording: Path, *others: Path) -> None:
    """Add the checksums of a recording and of the files that belong to it."""
    for path in (recording, *others):
        sha = hashlib.sha256(path.read_bytes()).hexdigest()
        if checksums.setdefault(path.name, sha) != sha:
            checksums[f"{recording.name}: {path.name}"] = sha
