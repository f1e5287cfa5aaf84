"""Figure: which fragments of a recording were named, when, and which were not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from besman.geometry.gaps import find_runs
from besman.report.figures import COLOURS, INK, new_figure, style
from besman.stages.label.named_recording import NamedRecording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_GREY, _UNSURE, _FILLED = "#c4c8ce", "#d55e00", "#e69f00"
_NAMED = tuple(colour for colour in COLOURS if colour not in (_UNSURE, _FILLED, "#999999"))
_MOST_LANES = 40


def name_timeline(named: NamedRecording) -> Figure:
    """Draw a time line: one lane for each marker, and below the fragments without a name.

    Parameters
    ----------
    named : NamedRecording

    Returns
    -------
    Figure
        Markers in colour, filled gaps orange, fragments held for no marker grey, those that were
        not sure red.
    """
    left = [decision for decision in named.decisions if not decision.named]
    lanes = _pack([(decision.start, decision.stop) for decision in left])
    n_lanes = min(max(lanes, default=-1) + 1, _MOST_LANES)
    n_rows = len(named.markers) + n_lanes
    figure = new_figure(9.0, 1.2 + 0.2 * n_rows)
    axes = figure.add_subplot()
    for row, marker in enumerate(named.markers):
        own = [d for d in named.decisions if d.named and d.marker == marker]
        spans = [_seconds(named, decision.start, decision.stop) for decision in own]
        axes.broken_barh(spans, (row - 0.38, 0.76), color=_NAMED[row % len(_NAMED)], linewidth=0)
        filled = [_seconds(named, int(a), int(b)) for a, b in find_runs(named.filled[:, row])]
        axes.broken_barh(filled, (row - 0.15, 0.3), color=_FILLED, linewidth=0)
        for start, _ in spans[1:]:
            axes.plot([start, start], [row - 0.38, row + 0.38], color="white", linewidth=0.8)
    for decision, lane in zip(left, lanes, strict=True):
        unsure = decision.confidence < named.threshold
        span = _seconds(named, decision.start, decision.stop)
        row = len(named.markers) + min(lane, _MOST_LANES - 1)
        axes.broken_barh([span], (row - 0.3, 0.6), color=_UNSURE if unsure else _GREY, linewidth=0)
    below = ["unnamed", *[""] * (n_lanes - 1)] if n_lanes else []
    axes.set_yticks(range(n_rows), [*named.markers, *below])
    axes.set_ylim(n_rows - 0.4, -0.6)
    axes.set_xlim(named.time[0], named.time[-1] + 1 / named.rate_hz)
    axes.set_xlabel("time [s]")
    axes.set_title(
        f"{named.source}: {len(named.decisions) - len(left)} fragments named, {len(left)} not "
        f"(grey: no marker; red: not sure); orange: filled gaps",
        loc="left",
    )
    axes.tick_params(length=0, colors=INK)
    style(axes)
    return figure


def _seconds(named: NamedRecording, start: int, stop: int) -> tuple[float, float]:
    """Return start and length of a range of rows, seconds."""
    return float(named.time[start]), (stop - start) / named.rate_hz


def _pack(ranges: list[tuple[int, int]]) -> list[int]:
    """Give each range the first lane that is free."""
    ends: list[int] = []
    lanes = []
    for start, stop in ranges:
        lane = int(np.argmax([end < start for end in ends] + [True]))
        if lane == len(ends):
            ends.append(0)
        ends[lane] = stop
        lanes.append(lane)
    return lanes
