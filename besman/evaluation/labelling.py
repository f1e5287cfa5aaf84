"""Experiment: how many marker samples get their right name, how many a wrong one.

Names are taken away, trajectories broken at every gap, gaps and ghosts added by
`besman.evaluation.degradation`; recording k of a protocol is spoilt with seed ``1000 k + s`` for
``s`` from 0 to ``n_seeds - 1``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.config.resources import resource_folder
from besman.evaluation.degradation import GHOST, Degraded, DegradeRecipe, degrade_recording
from besman.evaluation.frame_tracker import track_frames
from besman.evaluation.takes import ExperimentTake, Protocol, make_protocols
from besman.stages.label.fragments import Fragments, split_fragments
from besman.stages.label.naming import label_fragments

if TYPE_CHECKING:
    from rich.table import Table

IntArray = npt.NDArray[np.int64]

# Share of samples missing (0: as recorded) and ghosts in a frame.
LEVELS = ((0.0, 0.0), (0.02, 0.0), (0.05, 0.5), (0.10, 1.0))


@dataclass
class _Tally:
    """Sums over the recordings of one row."""

    counts: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    n_clean: int = 0
    n_recordings: int = 0
    n_frames: int = 0
    seconds: float = 0.0

    def add(self, counts: tuple[int, int, int], n_frames: int, seconds: float) -> None:
        """Add one recording: samples seen, named right, named wrong; frames; seconds taken."""
        self.counts += counts
        self.n_clean += counts[2] == 0
        self.n_recordings += 1
        self.n_frames += n_frames
        self.seconds += seconds

    def figures(self) -> dict[str, Any]:
        """Return the metrics of the row."""
        visible, right, wrong = self.counts.tolist()
        return {
            "right_share": right / visible,
            "wrong_share": wrong / visible,
            "clean_share": self.n_clean / self.n_recordings,
            "n_recordings": self.n_recordings,
            "seconds_per_recording": self.seconds / self.n_recordings,
            "frames_per_s": self.n_frames / self.seconds,
        }


def evaluate_labelling(
    data: Path | None = None,
    n_seeds: int = 2,
    progress: Callable[[float], None] = lambda done: None,
) -> dict[str, Any]:
    """Name recordings whose names were taken away, beside a plain per-frame tracker.

    Parameters
    ----------
    data : Path, optional
        Folder of recordings with names, or of such folders; the embedded synthetic sample if not
        given.
    n_seeds : int
        How often each recording is spoilt.
    progress : callable
        Called with the share done.

    Returns
    -------
    dict
        ``experiment`` and ``rows``: dataset, source, method (``fragments`` or ``per_frame``),
        learnt_from, missing, ghosts_per_frame, and right_share and wrong_share of the marker
        samples seen, clean_share (recordings without a wrong name), n_recordings,
        seconds_per_recording, frames_per_s. For recordings without names n_fragments and
        named_share.

    Raises
    ------
    BesmanError
        If there is nothing to evaluate, or a file cannot be read.
    """
    protocols = make_protocols(
        data or resource_folder("data") / "stick_throw", synthetic=data is None
    )
    rows: list[dict[str, Any]] = []
    steps = [(protocol, level) for protocol in protocols for level in LEVELS]
    for done, (protocol, (missing, ghosts)) in enumerate(steps, start=1):
        if protocol.takes[0].markers:
            rows += _measure_level(protocol, missing, ghosts, n_seeds)
        elif not missing:
            rows.append(_measure_unnamed(protocol))
        progress(done / len(steps))
    return {"experiment": "labelling", "rows": rows}


def _measure_level(
    protocol: Protocol, missing: float, ghosts: float, n_seeds: int
) -> list[dict[str, Any]]:
    """Name all recordings of a protocol, spoilt at one level, with both methods."""
    recipe = DegradeRecipe(missing, ghosts)
    ours, plain = _Tally(), _Tally()
    for k, take in enumerate(protocol.takes):
        for seed in range(n_seeds):
            spoilt = degrade_recording(take.positions, take.rate_hz, recipe, 1000 * k + seed)
            start = time.perf_counter()
            fragments = split_fragments(spoilt.positions, take.rate_hz)
            labels = label_fragments(fragments, protocol.model).labels
            seconds = time.perf_counter() - start
            truth = spoilt.truth[fragments.start, fragments.column]
            ours.add(count_samples(fragments, labels, truth), len(take.positions), seconds)
            plain.add(*_track(take, spoilt))
    head = {
        "dataset": protocol.dataset,
        "source": "synthetic" if protocol.takes[0].synthetic else "real",
        "learnt_from": protocol.learnt_from,
        "named": ", ".join(sorted({take.person for take in protocol.takes})),
        "missing": missing,
        "ghosts_per_frame": ghosts,
    }
    return [
        {**head, "method": method, **tally.figures()}
        for method, tally in (("fragments", ours), ("per_frame", plain))
    ]


def _track(take: ExperimentTake, spoilt: Degraded) -> tuple[tuple[int, int, int], int, float]:
    """Name a recording frame by frame, from a start that is given."""
    first = int(np.isfinite(take.positions[..., 0]).sum(axis=1).argmax())
    start = time.perf_counter()
    named = track_frames(spoilt.positions, take.positions[first], first)
    seconds = time.perf_counter() - start
    visible = spoilt.truth != GHOST
    right = int((named[visible] == spoilt.truth[visible]).sum())
    wrong = int(((named != GHOST) & (named != spoilt.truth)).sum())
    return (int(visible.sum()), right, wrong), len(take.positions), seconds


def _measure_unnamed(protocol: Protocol) -> dict[str, Any]:
    """Say how much of recordings without truth gets a name."""
    n_fragments = named = seen = 0
    for take in protocol.takes:
        fragments = split_fragments(take.positions, take.rate_hz)
        labels = label_fragments(fragments, protocol.model).labels
        n_fragments += fragments.n_fragments
        named += int(fragments.n_samples[labels != GHOST].sum())
        seen += int(fragments.n_samples.sum())
    return {
        "dataset": protocol.dataset,
        "source": "synthetic" if protocol.takes[0].synthetic else "real",
        "method": "fragments",
        "learnt_from": protocol.learnt_from,
        "named": ", ".join(take.source for take in protocol.takes),
        "n_recordings": len(protocol.takes),
        "n_fragments": n_fragments,
        "named_share": named / seen,
    }


def count_samples(fragments: Fragments, labels: IntArray, truth: IntArray) -> tuple[int, int, int]:
    """Count visible marker samples, those named right and those named wrong (ghosts included).

    Parameters
    ----------
    fragments : Fragments
    labels, truth : int array, shape (N,)
        Marker of each fragment, `GHOST` for none.
    """
    n = fragments.n_samples
    visible = int(n[truth != GHOST].sum())
    right = int(n[(labels == truth) & (truth != GHOST)].sum())
    wrong = int(n[(labels != truth) & (labels != GHOST)].sum())
    return visible, right, wrong


def labelling_table(rows: list[dict[str, Any]]) -> Table:
    """Return the rows as a table for the terminal: both methods side by side."""
    from rich.table import Table

    table = Table()
    table.add_column("recordings")
    for column in ("missing", "right %", "wrong %", "clean %", "plain %", "s each"):
        table.add_column(column)
    ours = [row for row in rows if row["method"] == "fragments"]
    plain = iter(row for row in rows if row["method"] == "per_frame")
    for row in ours:
        head = f"{row['dataset']} ({row['source']})\n{row['named']}, by {row['learnt_from']}"
        if "named_share" in row:
            share = f"{100 * row['named_share']:.1f} of samples"
            table.add_row(head, f"{row['n_fragments']} fragments", share)
            continue
        other = next(plain)
        level = f"{row['missing']:.0%}" if row["missing"] else "as recorded"
        if row["ghosts_per_frame"]:
            level += f" + {row['ghosts_per_frame']:g} ghosts"
        table.add_row(
            head,
            level,
            f"{100 * row['right_share']:.3f}",
            f"{100 * row['wrong_share']:.3f}",
            f"{100 * row['clean_share']:.0f}",
            f"{100 * other['right_share']:.2f} / {100 * other['wrong_share']:.2f}",
            f"{row['seconds_per_recording']:.3f}",
        )
    return table
