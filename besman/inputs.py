"""The pipeline's first step: recordings and, where there are any, their manual segments."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import RecordingError
from besman.io.recordings import find_recordings, read_recording
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
    checksums : dict of str
        SHA-256 of every file by its name.
    """

    recordings: tuple[Recording, ...]
    truth: tuple[LabelledSegments | None, ...]
    checksums: dict[str, str]


def read_inputs(paths: Sequence[str]) -> Inputs:
    """Read recordings, and the segments files beside them.

    Parameters
    ----------
    paths : sequence of str
        Files or folders.

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
    recordings, truth, checksums = [], [], {}
    for file in files:
        recording = read_recording(file)
        segments = find_segments(file)
        recordings.append(recording)
        truth.append(None if segments is None else read_segments(segments, recording))
        for path in (file, segments):
            if path is not None:
                checksums[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return Inputs(tuple(recordings), tuple(truth), checksums)
