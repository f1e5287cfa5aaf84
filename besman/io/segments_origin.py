"""Which recording a segments file belongs to: what stands in it, and what it is held against."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, nearest
from besman.io.warning import warn_of_file
from besman.records import LabelledRecording, Recording

ORIGIN = "recording"
"""Key of a segments file that is an object."""

Origin = dict[str, Any]
"""``first frame``, ``frames``, ``rate_hz`` and, where samples are known, ``sha256``."""

_FRAMES = ("first frame", "frames", "rate_hz")
_DIGEST = "sha256"
# Enough to tell takes apart, at hardly any cost.
_DIGESTED_FRAMES = 1000
# Rates are rounded in files.
_RATE_TOLERANCE = 1e-3


def describe_origin(recording: Recording | LabelledRecording, whole: bool = True) -> Origin:
    """Return what a segments file says of its recording.

    Parameters
    ----------
    recording : Recording or LabelledRecording
        As it was read. Of a labelled one, whose gaps were filled, there is no digest.
    whole : bool
        Whether reading gives these places back; without, there is no digest. Of a file that holds
        angles it does not.

    Returns
    -------
    dict
        ``sha256`` is of the places seen in a thousand frames spread over the recording, to a
        micrometre, whatever they are called and in whichever order they stand: the same take with
        its markers named, or written in another format, has the same.
    """
    origin: Origin = {
        "first frame": recording.first_frame,
        "frames": len(recording.time),
        "rate_hz": float(recording.rate_hz),
    }
    if isinstance(recording, LabelledRecording) or not whole:
        return origin
    rows = np.unique(np.linspace(0, len(recording.time) - 1, _DIGESTED_FRAMES).astype(np.int64))
    places = recording.positions[rows]
    seen = np.asarray(np.isfinite(places).all(axis=2))
    # Twice, as writing a TSV does: what is written and read back has the same.
    whole_um = np.where(seen[..., None], np.rint(places * 1e3 * 1e3), 0.0).astype("<i8")
    order = np.lexsort((*np.moveaxis(whole_um, 2, 0), ~seen), axis=1)
    whole_um = np.take_along_axis(whole_um, order[..., None], axis=1)
    sha = hashlib.sha256()
    for row, of_row, n_seen in zip(rows, whole_um, seen.sum(axis=1), strict=True):
        sha.update(np.int64(row).tobytes() + of_row[:n_seen].tobytes())
    return {**origin, _DIGEST: sha.hexdigest()}


def check_origin(said: Any, origin: Origin, source: str, path: Path) -> None:
    """Hold what a segments file says of its recording against the one it is read for.

    Parameters
    ----------
    said : object
        What stands in the file.
    origin : dict
        What `describe_origin` says of the recording.
    source : str
        Name of the recording.
    path : Path
        The segments file, named in messages.

    Raises
    ------
    RecordingError
        If it is not of this layout, or the recording has other frames or another rate.

    Warns
    -----
    RecordingWarning
        If the recording has as many frames, but other places: another take, or this one after its
        gaps were filled or its trajectories mended.
    """
    _check_layout(said, path)
    rate = origin["rate_hz"]
    is_same = abs(said["rate_hz"] - rate) <= _RATE_TOLERANCE * rate
    if not is_same or any(said[key] != origin[key] for key in _FRAMES[:2]):
        raise RecordingError(
            f"{path}: belongs to another recording: {source} has {_describe(origin)}; expected "
            f"{_describe(said)}, of which the segments were made; if they are of this one "
            f"nevertheless, take {ORIGIN!r} out of the file"
        )
    if _DIGEST in said and _DIGEST in origin and said[_DIGEST] != origin[_DIGEST]:
        warn_of_file(
            f"{path.name}: the segments were made of another recording of as many frames, or of "
            f"{source} before its samples were changed: digest {origin[_DIGEST][:12]}, expected "
            f"{said[_DIGEST][:12]!r}"
        )


def _check_layout(said: Any, path: Path) -> None:
    """Refuse what `describe_origin` would not write."""
    where = f"{path}: {ORIGIN}"
    if not isinstance(said, dict) or not set(_FRAMES) <= set(said):
        raise RecordingError(f"{where}: got {said!r:.80}, expected the keys {', '.join(_FRAMES)}")
    allowed = (*_FRAMES, _DIGEST)
    unknown = sorted(set(said) - set(allowed))
    if unknown:
        raise RecordingError(f"{where}: no key {unknown[0]!r:.40}; {nearest(unknown[0], allowed)}")
    whole = all(type(said[key]) is int and said[key] >= 0 for key in _FRAMES[:2])
    rate = said["rate_hz"]
    is_rate = type(rate) in (int, float) and 0 < rate < np.inf
    if not (whole and is_rate and isinstance(said.get(_DIGEST, ""), str)):
        raise RecordingError(
            f"{where}: got {said!r:.80}, expected two whole numbers from 0, a rate in Hz and, if "
            "given, a digest"
        )


def _describe(origin: Origin) -> str:
    """Say how many frames there are."""
    first, count = origin["first frame"], origin["frames"]
    return f"{count} frames, {first} to {first + count - 1}, at {origin['rate_hz']:g} Hz"
