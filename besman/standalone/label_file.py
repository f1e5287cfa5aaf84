"""Naming the markers of one recording, without a pipeline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.exceptions import LabellingError
from besman.io.atomic_files import check_file, written_aside
from besman.io.recordings.format import Columns
from besman.io.recordings.formats import find_writer, read_recording, write_recording
from besman.person.marker_set import load_marker_set
from besman.person.mirror import mirror_name, mirror_positions, mirror_recording
from besman.records.frozen import FloatArray, hand_over
from besman.stages.label.gather import LeftOver, found_markers, gather_markers
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.label.named_recording import NamedRecording
from besman.stages.label.person_check import check_person
from besman.stages.label.results import TrajectoryNames, review_rows
from besman.stages.label.trajectories import decide_names, fill_in_place

if TYPE_CHECKING:
    from rich.table import Table


def label_file(
    path: Path,
    markers: str,
    out: Path,
    learn_from: Path | None = None,
    fill: bool = False,
    ignore_names: bool = False,
) -> tuple[TrajectoryNames, NamedRecording]:
    """Name the trajectories of a recording and write it with names.

    Names that it has are kept where they fit the marker set. What got no name is written too.

    Parameters
    ----------
    path : Path
        The recording.
    markers : str
        A marker set.
    out : Path
        File to write; must not be there yet.
    learn_from : Path, optional
        A recording with names, from which distances are learnt.
    fill : bool
        Whether to fill short gaps.
    ignore_names : bool
        Whether all trajectories are named anew, whatever they are called.

    Returns
    -------
    tuple of (str or None)
        Names of the trajectories that were read.
    NamedRecording
        What was found in them.

    Raises
    ------
    BesmanError
        If a file cannot be read or written, or the marker set does not fit.
    """
    if out.exists():
        raise LabellingError(f"{out}: is there already; give another name with --out")
    find_writer(out)
    check_file(out)
    config = DefaultLabelConfig(markers=markers)
    marker_set = load_marker_set(markers)
    recording = read_recording(path)
    if ignore_names:
        recording = replace(recording, names=(None,) * len(recording.names))
    given = marker_set.find(recording.names, recording.source) or None
    teacher = None if learn_from is None else read_recording(learn_from)
    model = config.learn(marker_set, teacher)
    is_mirrored = marker_set.side == "left"
    if is_mirrored:
        recording = mirror_recording(recording)
    decisions = decide_names(recording, marker_set, model, config.threshold, given)
    found = found_markers(decisions, marker_set)
    positions = gather_markers(recording, decisions, found)
    read_names = recording.names
    left: Columns = LeftOver(recording, decisions)
    recording = recording.without_samples()
    filled = np.zeros((len(positions), len(found)), dtype=np.bool_)
    if fill:
        longest = config.fill_samples(recording.rate_hz)
        filled = fill_in_place(positions, found, marker_set, *longest)
    named = NamedRecording(
        time=recording.time,
        positions=hand_over(positions),
        markers=found,
        filled=filled,
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
        decisions=decisions,
        threshold=config.threshold,
    )
    check_person(named, marker_set)
    written = replace(recording, positions=named.positions, names=found)
    if is_mirrored:
        own = tuple(mirror_name(name) for name in found)
        written = replace(mirror_recording(written), names=own)
        left = _Mirrored(left)
    # Of an hour one array has hundreds of megabytes: what is left is put together as it is written.
    write_recording(written, out, left)
    return read_names, named


class _Mirrored:
    """What is left of trajectories, as it was before it was mirrored."""

    def __init__(self, left: Columns) -> None:
        self.names, self._left = left.names, left

    def rows(self, start: int, stop: int) -> FloatArray:
        return mirror_positions(self._left.rows(start, stop))


def summarise(names: TrajectoryNames, named: NamedRecording) -> dict[str, Any]:
    """Return what was named: by marker, in all, and what is for review.

    Parameters
    ----------
    names : tuple of (str or None)
        Of the trajectories that were read.
    named : NamedRecording

    Returns
    -------
    dict
        recording, fragments, n_unnamed, named_share (of samples seen), markers (marker, fragments,
        seen_share of the frames, least confidence), review.
    """
    decisions = named.decisions
    samples = sum(decision.stop - decision.start for decision in decisions)
    given = [decision for decision in decisions if decision.named]
    rows = []
    for marker in named.markers:
        own = [decision for decision in given if decision.marker == marker]
        n_seen = sum(decision.stop - decision.start for decision in own)
        rows.append(
            {
                "marker": marker,
                "fragments": len(own),
                "seen_share": n_seen / len(named.time),
                "confidence": min(decision.confidence for decision in own),
            }
        )
    return {
        "recording": named.source,
        "fragments": len(decisions),
        "n_unnamed": len(decisions) - len(given),
        "named_share": sum(decision.stop - decision.start for decision in given) / samples,
        "filled_samples": int(named.filled.sum()),
        "markers": rows,
        "review": review_rows(names, named),
    }


def summary_tables(summary: dict[str, Any]) -> list[Table]:
    """Return what `summarise` gives as tables for the terminal."""
    from rich.table import Table

    share = f"{100 * summary['named_share']:.1f} % of the samples seen are named"
    markers = Table("marker", "fragments", "seen", "least confidence", title=share)
    for row in summary["markers"]:
        markers.add_row(
            row["marker"],
            str(row["fragments"]),
            f"{100 * row['seen_share']:.1f} %",
            f"{row['confidence']:.3f}",
        )
    if not summary["review"]:
        return [markers]
    review = Table("trajectory", "frames", "best name", "confidence", title="for review")
    for row in summary["review"]:
        review.add_row(
            row["trajectory"],
            f"{row['first_frame']} to {row['last_frame']}",
            row["best"] or "no marker",
            f"{row['confidence']:.3f}",
        )
    return [markers, review]


def draw_names(named: NamedRecording, path: Path) -> None:
    """Draw when each marker was seen, and the fragments without a name; PNG or SVG by the ending.

    Raises
    ------
    LabellingError
        If the ending is another one.
    FileError
        If it cannot be written.
    """
    from besman.report.name_figure import name_timeline

    check_figure(path)
    with written_aside(path) as temporary:
        name_timeline(named).savefig(temporary, dpi=120, facecolor="white")


def check_figure(path: Path) -> None:
    """Refuse a figure that is neither PNG nor SVG.

    Raises
    ------
    LabellingError
    """
    if path.suffix.lower() not in (".png", ".svg"):
        raise LabellingError(f"{path}: got ending {path.suffix!r}, expected .png or .svg")
