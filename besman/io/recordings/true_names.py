"""The true names of the trajectories of a synthetic capture, in a JSON file beside it."""

from __future__ import annotations

from pathlib import Path

from besman.exceptions import RecordingError
from besman.foreign.json_text import parse_json
from besman.foreign.names import fault_of_name
from besman.records import Recording

_ENDING = "_truth.json"


def find_true_names(path: Path) -> Path | None:
    """Return the truth file beside a recording, None if there is none.

    Parameters
    ----------
    path : Path
        The recording.
    """
    beside = path.with_name(path.stem + _ENDING)
    return beside if beside.is_file() else None


def read_true_names(path: Path, recording: Recording) -> tuple[str, ...] | None:
    """Read which marker each trajectory is.

    Parameters
    ----------
    path : Path
        JSON with the list ``trajectories``: a marker's name, or ``ghost``, for each.
    recording : Recording
        What the file belongs to.

    Returns
    -------
    tuple of str, or None
        One name for each trajectory; None if the file says nothing of trajectories.

    Raises
    ------
    RecordingError
        If the file is no JSON or does not fit the recording.
    """
    try:
        content = parse_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read as JSON: {error}") from None
    names = content.get("trajectories") if isinstance(content, dict) else None
    if names is None:
        return None
    if isinstance(names, dict):
        names = list(names.values())
    if not isinstance(names, list) or len(names) != len(recording.names):
        got = len(names) if isinstance(names, list) else repr(names)
        raise RecordingError(
            f"{path}: trajectories: got {got} names, expected one for each of "
            f"{len(recording.names)} trajectories of {recording.source}"
        )
    for index, name in enumerate(names, start=1):
        fault = fault_of_name(name) if isinstance(name, str) else "is no text"
        if fault is not None:
            raise RecordingError(f"{path}: trajectories: name {index}, {name!r:.60}, {fault}")
    return tuple(names)
