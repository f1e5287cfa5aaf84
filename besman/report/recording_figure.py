"""Figure: a recording as stick figures at three moments, and what is seen when."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.exceptions import RecordingError, one_line
from besman.geometry.gaps import find_runs
from besman.geometry.stick_links import find_links
from besman.io.atomic_files import written_aside
from besman.person.mirror import find_side
from besman.records import FloatArray, Recording
from besman.report.figures import COLOURS, INK, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIDES = {"left": COLOURS[0], "right": COLOURS[5], "": "#5c636b"}
_MOST_ROWS, _MOST_LABELS = 80, 16
_STEP_S = 0.1
_LONGEST_LINE_M = 0.8
_ENDINGS = (".png", ".svg")
_LEGEND = "blue: left, orange: right, as their names say"


def draw_sticks_and_gaps(recording: Recording, markers: Collection[str], path: Path) -> None:
    """Draw a recording; PNG or SVG by the path's ending.

    Parameters
    ----------
    recording : Recording
    markers : collection of str
        Trajectories, as the file calls them, to write names at.
    path : Path

    Raises
    ------
    RecordingError
        If the ending is another one, or nothing is ever seen.
    FileError
        If it cannot be written.
    """
    if path.suffix.lower() not in _ENDINGS:
        raise RecordingError(f"{path}: got ending {path.suffix!r}, expected .png or .svg")
    if not np.isfinite(recording.positions).any():
        raise RecordingError(f"{recording.source}: nothing is ever seen in it")
    with written_aside(path) as temporary:
        recording_figure(recording, markers).savefig(temporary, dpi=120, facecolor="white")


def recording_figure(recording: Recording, markers: Collection[str]) -> Figure:
    """Draw stick figures at the start, at the fastest moment and at the end, and a gap chart.

    Parameters
    ----------
    recording : Recording
    markers : collection of str
        Trajectories to write names at.

    Returns
    -------
    Figure
        Left blue, right orange, what has no side grey; seen from where it is widest, z up.
    """
    n_rows = min(len(recording.names), _MOST_ROWS)
    figure = new_figure(11.0, 4.8 + 0.15 * n_rows)
    grid = figure.add_gridspec(2, 3, height_ratios=(4.2, 0.6 + 0.15 * n_rows))
    moments = _choose_moments(recording)
    links = find_links(recording.positions)
    across = _widest(recording.positions[moments])
    flat = np.stack((recording.positions[moments] @ across, recording.positions[moments, :, 2]), 2)
    # Where a person walks, every figure stands in the middle of its panel.
    middles = np.nanmedian(flat[:, :, :1], axis=1, keepdims=True)
    flat -= np.concatenate((middles, np.zeros_like(middles)), axis=2)
    # A reflection far away must not make the person small.
    wide = float(np.nanpercentile(np.abs(flat[:, :, 0]), 95))
    low, high = np.nanpercentile(flat[:, :, 1], [1.0, 99.0])
    half = 1.15 * max(0.5 * (high - low), wide) + 0.02
    for column, (moment, points) in enumerate(zip(moments, flat, strict=True)):
        axes = figure.add_subplot(grid[0, column])
        axes.set_xlim(-half, half)
        axes.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
        _draw_sticks(axes, points, recording.names, links)
        if column == 1:
            _write_names(axes, points, recording.names, markers)
        at = recording.time[moment] - recording.time[0]
        axes.set_title(f"{('start', 'fastest', 'end')[column]}, at {at:.2f} s", loc="left")
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlabel("across [m]")
        axes.set_ylabel("height [m]" if column == 0 else "")
        axes.grid(color="#e4e7eb", linewidth=0.6)
        style(axes)
    _draw_gaps(figure.add_subplot(grid[1, :]), recording, n_rows)
    sided = any(find_side(name or "") for name in recording.names)
    figure.suptitle(
        one_line(recording.source) + (f"    {_LEGEND}" if sided else ""),
        x=0.01,
        ha="left",
        color=INK,
        fontsize=10,
    )
    return figure


def _choose_moments(recording: Recording) -> list[int]:
    """Return the first and the last moment that show much, and the fastest one between."""
    seen = np.isfinite(recording.positions).all(axis=2)
    counts = seen.sum(axis=1)
    rows = np.flatnonzero(counts >= np.quantile(counts, 0.9))
    step = max(1, round(_STEP_S * recording.rate_hz))
    ahead = np.minimum(rows + step, len(counts) - 1)
    ways = np.linalg.norm(recording.positions[ahead] - recording.positions[rows], axis=2)
    fastest = rows[int(np.argmax(np.nan_to_num(ways).max(axis=1, initial=0.0)))]
    return [int(rows[0]), int(fastest), int(rows[-1])]


def _widest(positions: FloatArray) -> FloatArray:
    """Return the horizontal direction, (3,), along which figures are widest."""
    parts = []
    for points in positions:
        seen = points[np.isfinite(points).all(axis=1), :2]
        parts.append(seen - seen.mean(axis=0) if len(seen) else seen)
    _, _, directions = np.linalg.svd(np.concatenate(parts), full_matrices=False)
    direction = directions[0] * (1.0 if directions[0].sum() > 0 else -1.0)
    return np.array([direction[0], direction[1], 0.0])


def _draw_sticks(
    axes: Any, points: FloatArray, names: tuple[str | None, ...], links: list[tuple[int, int]]
) -> None:
    """Draw points (M, 2) and the lines between them."""
    sides = [find_side(name or "") for name in names]
    for first, second in links:
        if np.linalg.norm(points[first] - points[second]) > _LONGEST_LINE_M:
            continue  # two things took turns under one name
        side = sides[first] if sides[first] == sides[second] else ""
        axes.plot(*points[[first, second]].T, color=_SIDES[side], linewidth=1.4, alpha=0.7)
    axes.scatter(*points.T, s=14, color=[_SIDES[side] for side in sides], zorder=3)


def _write_names(
    axes: Any, points: FloatArray, names: tuple[str | None, ...], markers: Collection[str]
) -> None:
    """Write names at points, as long as they can be told apart."""
    shown = [at for at, name in enumerate(names) if name and np.isfinite(points[at]).all()]
    if len(shown) > _MOST_LABELS:
        shown = [at for at in shown if names[at] in markers]
    if len(shown) > _MOST_LABELS:
        return
    lowest = -np.inf
    # In order of height, each at least a line above the last one, beside the figure.
    height = np.ptp(axes.get_ylim()) / 22
    right = np.nanmax(points[:, 0]) + 0.04 * np.ptp(axes.get_xlim())
    for at in sorted(shown, key=lambda one: points[one, 1]):
        lowest = max(lowest + height, points[at, 1])
        axes.annotate(
            one_line(str(names[at]))[:24],
            points[at],
            xytext=(right, lowest),
            fontsize=7,
            color=INK,
            va="center",
            parse_math=False,
            # From the left edge of the name, not from its middle and through the others.
            arrowprops={
                "arrowstyle": "-",
                "color": "#c4c8ce",
                "linewidth": 0.5,
                "relpos": (0.0, 0.5),
                "shrinkA": 1,
            },
        )


def _draw_gaps(axes: Any, recording: Recording, n_rows: int) -> None:
    """Draw when each trajectory is seen, those with the longest gaps if there are too many."""
    hidden = np.isnan(recording.positions[:, :, 0])
    order = np.arange(len(recording.names))
    if len(order) > n_rows:
        order = np.sort(np.argsort(-hidden.sum(axis=0), kind="stable")[:n_rows])
    for row, column in enumerate(order):
        spans = [
            (start / recording.rate_hz, (end - start) / recording.rate_hz)
            for start, end in find_runs(np.asarray(~hidden[:, column]))
        ]
        colour = _SIDES[find_side(recording.names[column] or "")]
        axes.broken_barh(spans, (row - 0.35, 0.7), color=colour, linewidth=0, alpha=0.75)
    labels = [
        one_line(recording.names[column] or f"without name {column + 1}")[:24] for column in order
    ]
    axes.set_yticks(range(len(order)), labels, parse_math=False)
    axes.set_ylim(len(order) - 0.4, -0.6)
    axes.set_xlim(0.0, len(recording.time) / recording.rate_hz)
    axes.set_xlabel("time [s]")
    whole = int((~hidden.any(axis=0)).sum())
    axes.set_title(f"seen when: {whole} of {len(recording.names)} all the time", loc="left")
    style(axes)
    axes.tick_params(axis="y", length=0, labelsize=7)
