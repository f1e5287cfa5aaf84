"""A simulated recording together with its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import RecordingError
from besman.io.qtm_tsv import write_tsv
from besman.io.segments_json import ThrowEvent, segments_path, write_segments
from besman.records import LabelledSegments, Recording


@dataclass(frozen=True, eq=False)
class Capture:
    """What the cameras saw of a simulated person, and what really happened.

    Attributes
    ----------
    recording : Recording
        With noise; markers named as a file spells them.
    segments : LabelledSegments
        True segments.
    throws : tuple of ThrowEvent
        True release and touchdown of every throw.
    """

    recording: Recording
    segments: LabelledSegments
    throws: tuple[ThrowEvent, ...]


def write_dataset(captures: Sequence[Capture], folder: Path) -> list[Path]:
    """Write captures as Qualisys TSV with a segments file beside each.

    Parameters
    ----------
    captures : sequence of Capture
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        The recordings written.

    Raises
    ------
    RecordingError
        If one of the files is there already.
    """
    paths = [folder / capture.recording.source for capture in captures]
    for path in [*paths, *map(segments_path, paths)]:
        if path.exists():
            raise RecordingError(f"{path}: is there already and is not overwritten")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for capture, path in zip(captures, paths, strict=True):
            write_tsv(capture.recording, path)
            write_segments(capture.segments, segments_path(path), capture.throws)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror}") from None
    return paths
