"""Figures of the labelling stage for ``results.json``."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.geometry.gaps import BoolArray, find_runs
from besman.person.marker_set import MarkerSet, normalise_name
from besman.records import LabelledRecording, Recording
from besman.stages.label.named_recording import NamedRecording

TrajectoryNames = tuple[str | None, ...]
"""Names of a recording's trajectories, None of those that have none."""


def label_results(
    recordings: tuple[Recording, ...],
    labelled: tuple[LabelledRecording, ...],
    marker_set: MarkerSet,
    truth: tuple[tuple[str, ...] | None, ...] = (),
    *,
    looks_at_names: bool = True,
) -> dict[str, Any]:
    """Return the figures of the labelling.

    Parameters
    ----------
    recordings : tuple of Recording
    labelled : tuple of LabelledRecording
        What the stage made of them.
    marker_set : MarkerSet
    truth : tuple of (tuple of str or None)
        For each recording the marker that each trajectory is, "ghost" for none; None where that
        is not known.
    looks_at_names : bool
        Whether names that trajectories carry were taken.

    Returns
    -------
    dict
        ``n_recordings``; ``names``: of each recording how many markers it named itself, ``taken``,
        and how many were ``found``; ``fragments``: unbroken stretches of trajectories;
        ``n_unnamed``: those without a name; ``named_share``: named share of all samples seen;
        ``filled_samples``; ``review``: what a person should look at; with truth ``right_share``
        and ``wrong_share`` of the marker samples seen.
    """
    fragments = n_unnamed = seen_samples = named_samples = filled_samples = 0
    review: list[dict[str, Any]] = []
    names: list[dict[str, Any]] = []
    counts = np.zeros(3, dtype=np.int64)
    for index, (recording, result) in enumerate(zip(recordings, labelled, strict=True)):
        seen: BoolArray = np.all(np.isfinite(recording.positions), axis=2)
        runs = [len(find_runs(column)) for column in seen.T]
        fragments += sum(runs)
        seen_samples += int(seen.sum())
        worn = [name not in marker_set.derived for name in result.markers]
        is_named = np.isfinite(result.positions[:, :, 0]) & ~result.filled
        named_samples += int(is_named[:, worn].sum())
        filled_samples += int(result.filled[:, worn].sum())
        own = marker_set.find(recording.names, recording.source) if looks_at_names else {}
        taken = len(own.keys() & set(result.markers))
        n_found = sum(worn) - taken
        names.append({"recording": recording.source, "taken": taken, "found": n_found})
        if isinstance(result, NamedRecording):
            n_unnamed += sum(not decision.named for decision in result.decisions)
            review += review_rows(recording.names, result)
            if truth and truth[index] is not None:
                counts += count_names(result, truth[index] or ())
        else:
            left_out = _left_out(recording, marker_set)
            n_unnamed += sum(runs[column] for column in left_out)
            review += [
                {
                    "recording": recording.source,
                    "trajectory": trajectory_name(recording.names, column),
                    "reason": f"no marker of {marker_set.name}",
                }
                for column in left_out
            ]
    results: dict[str, Any] = {
        "n_recordings": len(recordings),
        "names": names,
        "fragments": fragments,
        "n_unnamed": n_unnamed,
        "named_share": named_samples / seen_samples if seen_samples else 0.0,
        "filled_samples": filled_samples,
        "review": review,
    }
    if counts[0]:
        results |= {
            "right_share": float(counts[1] / counts[0]),
            "wrong_share": float(counts[2] / counts[0]),
        }
    return results


def review_rows(names: TrajectoryNames, named: NamedRecording) -> list[dict[str, Any]]:
    """List the decisions a person should look at, with frame numbers as in the file."""
    return [
        {
            "recording": named.source,
            "trajectory": trajectory_name(names, decision.trajectory),
            "first_frame": named.first_frame + decision.start,
            "last_frame": named.first_frame + decision.stop - 1,
            "best": decision.marker or None,
            "confidence": decision.confidence,
        }
        for decision in named.review
    ]


def count_names(named: NamedRecording, truth: tuple[str, ...]) -> tuple[int, int, int]:
    """Count the marker samples seen, those named right, and those named wrong.

    A ghost that got a name counts as wrong.

    Parameters
    ----------
    named : NamedRecording
    truth : tuple of str
        Marker of each trajectory, "ghost" for none.
    """
    visible = right = wrong = 0
    for decision in named.decisions:
        n = decision.stop - decision.start
        true = normalise_name(truth[decision.trajectory])
        visible += n * (true != "ghost")
        if decision.named:
            is_right = normalise_name(decision.marker) == true
            right += n * is_right
            wrong += n * (not is_right)
    return visible, right, wrong


def trajectory_name(names: TrajectoryNames, column: int) -> str:
    """Say which trajectory is meant: its name in the file, or its number from 1."""
    return names[column] or f"trajectory {column + 1}"


def _left_out(recording: Recording, marker_set: MarkerSet) -> list[int]:
    """Return the trajectories that are no marker."""
    used = set(marker_set.match(recording.names, recording.source).values())
    return [column for column in range(len(recording.names)) if column not in used]
