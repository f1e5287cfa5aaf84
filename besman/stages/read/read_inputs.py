"""The pipeline's first step: recordings and, where there are any, their manual segments."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.config.resources import resource_folder
from besman.exceptions import RecordingError, RecordingWarning
from besman.io.landings import read_landings
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import find_companions, read_recording
from besman.io.recordings.true_names import find_true_names, read_true_names
from besman.io.ring_landings import find_ring_landing
from besman.io.segments_json import find_segments, read_segments
from besman.records import LabelledSegments, Landing, Recording
from besman.stages.read.config import ReadConfig

# Enough to tell takes apart; what is written as text or in single precision is rounded.
_COMPARED_FRAMES = 20
_SAME_PLACE_M = 2e-5
_AS_FILES_SAY = ReadConfig()


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
    landings : tuple of Landing
        Where throws came down, as a landing file says, or the recording's own.
    """

    recordings: tuple[Recording, ...]
    truth: tuple[LabelledSegments | None, ...]
    names: tuple[tuple[str, ...] | None, ...]
    teacher: Recording | None
    checksums: dict[str, str]
    landings: tuple[Landing, ...] = ()


def read_inputs(
    paths: Sequence[str],
    teacher: str | None = None,
    config: ReadConfig = _AS_FILES_SAY,
    landing: str | None = None,
) -> Inputs:
    """Read recordings, and the segments and truth files beside them.

    Parameters
    ----------
    paths : sequence of str
        Files or folders.
    teacher : str, optional
        Recording that markers are learnt from.
    config : ReadConfig
        How files are read.
    landing : str, optional
        A landing file, see `besman.io.landings`; it is no recording, though it lie among them.

    Returns
    -------
    Inputs

    Raises
    ------
    RecordingError
        If a file is missing or damaged, or two recordings have one name.
    ConfigError
        If the landing file cannot be read.
    """
    _refuse_absent(paths)
    files = find_recordings([Path(path) for path in paths])
    landings: tuple[Landing, ...] = ()
    if landing is not None:
        landings = read_landings(Path(landing))
        files = [file for file in files if file.resolve() != Path(landing).resolve()]
    _refuse_twins(files)
    recordings, truth, names = [], [], []
    asked = config.model_dump()
    checksums: dict[str, str] = {}
    for file in files:
        recording = read_recording(file, **asked)
        segments = find_segments(file)
        recordings.append(recording)
        truth.append(None if segments is None else read_segments(segments, recording))
        names_file = find_true_names(file)
        names.append(None if names_file is None else read_true_names(names_file, recording))
        beside = (path for path in (segments, names_file) if path is not None)
        _note_checksums(checksums, file, *beside, *find_companions(file))
    learnt = None
    if teacher is not None:
        learnt = read_recording(Path(teacher), **asked)
        _note_checksums(checksums, Path(teacher), *find_companions(Path(teacher)))
    if landing is not None:
        _note_checksums(checksums, Path(landing))
    # A landing file counts more than what the recordings' own files say.
    landings += tuple(one for each in recordings if (one := find_ring_landing(each)) is not None)
    _warn_of_copies(recordings)
    return Inputs(tuple(recordings), tuple(truth), tuple(names), learnt, checksums, landings)


def _refuse_absent(paths: Sequence[str]) -> None:
    """Refuse recordings that a recipe names and that do not come with besman."""
    data = resource_folder("data").resolve()
    for path in (Path(path) for path in paths):
        if path.resolve().is_relative_to(data) and not path.exists():
            raise RecordingError(
                f"{path}: no such file or folder; these recordings do not come with besman: "
                "--set recordings=FOLDER names your own"
            )


def _refuse_twins(files: Sequence[Path]) -> None:
    """Refuse recordings of one name: segments files, motions and exports are called by it."""
    by_stem: dict[str, list[Path]] = {}
    for file in files:
        by_stem.setdefault(file.stem, []).append(file)
    for stem, twins in by_stem.items():
        if len(twins) > 1:
            raise RecordingError(
                f"{' and '.join(map(str, twins))}: two recordings have this name, {stem!r}, and "
                "motions and exports are called by it; rename one, or name the files to take, one "
                "by one"
            )


def _warn_of_copies(recordings: Sequence[Recording]) -> None:
    """Warn of two files with the same take, e.g. one as it was and one with markers named."""
    alike: dict[tuple[int, float], list[Recording]] = {}
    for recording in recordings:
        key = (len(recording.time), round(recording.rate_hz, 3))
        for other in alike.setdefault(key, []):
            if is_same_take(recording, other):
                warnings.warn(
                    f"{other.source} and {recording.source} hold the same take: its movements "
                    "count twice",
                    RecordingWarning,
                    stacklevel=3,
                )
        alike[key].append(recording)


def is_same_take(one: Recording, other: Recording) -> bool:
    """Tell whether two recordings of one length show the same points, whatever these are called.

    Parameters
    ----------
    one, other : Recording

    Returns
    -------
    bool
        Nine of ten points of the one with fewer are where one of the other's is.
    """
    seen = common = 0
    for row in np.unique(np.linspace(0, len(one.time) - 1, _COMPARED_FRAMES).astype(int)):
        points = [each.positions[row] for each in (one, other)]
        few, many = sorted((each[np.isfinite(each[:, 0])] for each in points), key=len)
        if len(few):
            apart = np.linalg.norm(few[:, None] - many, axis=2).min(axis=1)
            seen, common = seen + len(few), common + int((apart < _SAME_PLACE_M).sum())
    return seen > 0 and common >= 0.9 * seen


def _note_checksums(checksums: dict[str, str], recording: Path, *others: Path) -> None:
    """Add the checksums of a recording and of the files that belong to it."""
    for path in (recording, *others):
        sha = _digest(path)
        if checksums.setdefault(path.name, sha) != sha:
            checksums[f"{recording.name}: {path.name}"] = sha


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, or of all files of a recording that is a folder."""
    if not path.is_dir():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    from besman.io.recordings.frame_folder import digest_frame_files

    return digest_frame_files(path)
