"""Figures of what was refined: arrays in, SVG text out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from besman.records import FloatArray, RefinedMotion
from besman.report.figures import COLOURS, INK, draw_lines, new_figure, style, svg

_BAND_FROM = 4
_LINES = 40
_POINTS = 1200
_AXES = ("x forward", "y left", "z up")


def best_so_far(values: Sequence[FloatArray], greatest: bool) -> FloatArray:
    """Return the best value up to every episode; a search that has ended keeps its best.

    Parameters
    ----------
    values : sequence of N arrays, shape (E,)
        Of every episode of every search; NaN where it failed.
    greatest : bool
        Whether more is better.

    Returns
    -------
    array, shape (N, longest E)
        NaN before the first episode that did not fail.
    """
    longest = max((len(one) for one in values), default=0)
    best = np.full((len(values), longest), np.nan)
    for row, one in enumerate(values):
        sign = -1.0 if greatest else 1.0
        curve = np.minimum.accumulate(np.where(np.isnan(one), np.inf, sign * one))
        best[row, : len(curve)] = np.where(np.isinf(curve), np.nan, sign * curve)
        best[row, len(curve) :] = best[row, len(curve) - 1] if len(curve) else np.nan
    return best


def quantiles(values: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Return quantiles over the rows, shape (Q, E).

    NaN is left out, and the result where a column has no value; infinity counts as the worst.
    """
    result = np.full((len(shares), values.shape[1]), np.nan)
    some = ~np.isnan(values).all(axis=0)
    if some.any():
        low, high = (
            np.nanquantile(values[:, some], shares, axis=0, method=side)
            for side in ("lower", "higher")
        )
        with np.errstate(invalid="ignore"):
            between = np.nanquantile(values[:, some], shares, axis=0)
        # Nothing lies between a finite and an infinite value but infinity.
        result[:, some] = np.where(low == high, low, np.where(np.isinf(high), np.inf, between))
    return result


def _by_simulation(motion: RefinedMotion, values: FloatArray) -> FloatArray:
    """Repeat what is of an episode (E,) for each simulation that it took."""
    return np.repeat(values, motion.simulations)


def learning_curve(motions: Sequence[RefinedMotion], radius_m: float) -> str:
    """Draw the best miss so far over the episodes: median and quantiles over the motions.

    Returns
    -------
    str
        SVG; logarithmic centimetres.
    """
    best = 100 * best_so_far(
        [_by_simulation(motion, motion.misses) for motion in motions], greatest=False
    )
    # Else the median would rise when the last motions have an outcome at last.
    best[np.isnan(best)] = np.inf
    figure = new_figure(5, 3.4)
    axes = figure.add_subplot()
    _draw_quantiles(axes, best)
    again = [
        (motion.simulations[: motion.begins_again].sum(), best[row])
        for row, motion in enumerate(motions)
        if motion.begins_again
    ]
    if again:
        marks = [(at, curve[at]) for at, curve in again]
        axes.plot(*np.transpose(marks), "x", color=INK, ms=5, label="second round begins")
    axes.axhline(100 * radius_m, color=INK, linestyle="--", linewidth=0.8, label="success")
    _scale_by_decades(axes)
    axes.set_ylabel("best miss so far [cm]")
    return _finish(figure, axes, "episode")


def return_curve(motions: Sequence[RefinedMotion]) -> str:
    """Draw the best return so far over the episodes: median and quantiles over the motions.

    Returns
    -------
    str
        SVG; minus the return, logarithmic, because a return is minus a sum of costs.
    """
    best = -best_so_far(
        [_by_simulation(motion, motion.returns) for motion in motions], greatest=True
    )
    figure = new_figure(5, 3.4)
    axes = figure.add_subplot()
    _draw_quantiles(axes, np.maximum(best, 1e-4))
    _scale_by_decades(axes)
    axes.set_ylabel("cost: minus the best return so far")
    return _finish(figure, axes, "episode")


def _draw_quantiles(axes: Any, curves: FloatArray) -> None:
    """Draw curves (N, E) thin, or their quantiles as bands; and their median."""
    episodes = np.arange(curves.shape[1])
    if len(curves) <= _LINES:
        lines = [np.column_stack([episodes, curve]) for curve in curves]
        draw_lines(axes, lines, color=COLOURS[0], linewidth=0.5, alpha=0.4)
    bands = quantiles(curves, (0.05, 0.25, 0.5, 0.75, 0.95))
    middle = np.where(np.isinf(bands[2]), np.nan, bands[2])
    top = curves[np.isfinite(curves)].max(initial=0.0)
    low, lower, _, upper, high = np.minimum(bands, top)
    if len(curves) >= _BAND_FROM:
        band = {"color": COLOURS[0], "linewidth": 0}
        axes.fill_between(episodes, low, high, alpha=0.2, label="5 to 95 %", **band)
        axes.fill_between(episodes, lower, upper, alpha=0.35, label="25 to 75 %", **band)
    # A line through a single episode would not be seen.
    axes.plot(episodes, middle, color=COLOURS[5], linewidth=2, marker="o", ms=2.5, label="median")
    axes.set_xlim(-0.5, len(episodes) - 0.5)
    axes.xaxis.get_major_locator().set_params(integer=True)


def touchdown_map(
    motions: Sequence[RefinedMotion], targets: FloatArray, radius_m: float, plane: tuple[int, int]
) -> str:
    """Draw targets and where each motion ended, imitated and refined, in the robot's world.

    Parameters
    ----------
    motions : sequence of RefinedMotion
    targets : array, shape (N, 3)
        Target of each motion, metres.
    radius_m : float
        Radius of success.
    plane : pair of int
        Which coordinates to draw, across and up.

    Returns
    -------
    str
        SVG; metres.
    """
    from matplotlib.collections import EllipseCollection, LineCollection

    figure = new_figure(5, 4)
    axes = figure.add_subplot()
    pick = list(plane)
    before = np.array([motion.outcome_before for motion in motions]).reshape(-1, 3)[:, pick]
    after = np.array([motion.outcome for motion in motions]).reshape(-1, 3)[:, pick]
    wide = np.full(len(targets), 2 * radius_m)
    axes.add_collection(
        EllipseCollection(
            wide, wide, np.zeros(len(wide)), units="xy", offsets=targets[:, pick],
            transOffset=axes.transData, facecolors="none", edgecolors=COLOURS[2], linewidths=0.6,
        )
    )  # fmt: skip
    ways = np.stack([before, after], axis=1)
    axes.add_collection(
        LineCollection(ways[np.isfinite(ways).all(axis=(1, 2))], colors=INK, linewidths=0.5)
    )
    axes.plot(*targets[:, pick].T, "+", color=COLOURS[2], markersize=8, label="target")
    axes.plot(*before.T, "o", markerfacecolor="none", color=COLOURS[5], ms=5, label="imitated")
    axes.plot(*after.T, "o", color=COLOURS[0], markersize=4, label="refined")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_ylabel(f"{_AXES[plane[1]]} [m]")
    return _finish(figure, axes, f"{_AXES[plane[0]]} [m]")


def touchdowns_by_generation(
    motions: Sequence[RefinedMotion], targets: FloatArray, plane: tuple[int, int]
) -> str:
    """Draw where the throws of all generations ended, relative to their targets.

    Returns
    -------
    str
        SVG; centimetres, the central 95 % of all throws.
    """
    from matplotlib.ticker import MaxNLocator

    pick = list(plane)
    off = np.concatenate(
        [100 * (one.outcomes - goal)[:, pick] for one, goal in zip(motions, targets, strict=True)]
    )
    generations = np.concatenate([motion.generations for motion in motions])
    rows = np.flatnonzero(np.isfinite(off).all(axis=1))
    # Evenly spaced, drawn in the order of generations.
    some = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _POINTS)).astype(int))]
    some = some[np.argsort(generations[some], kind="stable")]
    figure = new_figure(5, 4)
    axes = figure.add_subplot()
    dots = axes.scatter(
        off[some, 0], off[some, 1], c=generations[some], s=9, cmap=_early_to_late(), linewidths=0
    )
    bar = figure.colorbar(dots, ax=axes, label="generation", ticks=MaxNLocator(integer=True))
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=8, colors=INK)
    if len(rows):
        reach = 1.1 * max(float(np.quantile(np.abs(off[rows]), 0.95)), 1.0)
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
    axes.axhline(0, color=INK, linewidth=0.4)
    axes.axvline(0, color=INK, linewidth=0.4)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{_AXES[plane[0]]} of the target [cm]")
    axes.set_ylabel(f"{_AXES[plane[1]]} of the target [cm]")
    style(axes)
    return svg(figure)


def _early_to_late() -> Any:
    """Return a colour map whose colours are all seen on white and on black."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("early_to_late", [COLOURS[1], COLOURS[3], COLOURS[0]])


def misses_by_generation(motions: Sequence[RefinedMotion], radius_m: float) -> str:
    """Draw quantiles of the misses of every generation, and the share of failed throws.

    Returns
    -------
    str
        SVG; logarithmic centimetres, and a share.
    """
    generations = np.concatenate([motion.generations for motion in motions])
    misses = 100 * np.concatenate([motion.misses for motion in motions])
    n = int(generations.max(initial=0)) + 1
    table = np.full((int(np.bincount(generations, minlength=n).max(initial=0)), n), np.nan)
    failed = np.full(n, np.nan)
    for generation in range(n):
        own = misses[generations == generation]
        table[: len(own), generation] = own
        failed[generation] = np.isnan(own).mean() if len(own) else np.nan
    figure = new_figure(5, 4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    _draw_quantiles(upper, np.concatenate([table, np.full((_LINES, n), np.nan)]))
    upper.axhline(100 * radius_m, color=INK, linestyle="--", linewidth=0.8, label="success")
    _scale_by_decades(upper)
    upper.set_ylabel("miss [cm]")
    upper.legend(fontsize=7, frameon=False, labelcolor=INK)
    style(upper)
    lower.bar(range(n), 100 * failed, color=COLOURS[5], width=0.8)
    lower.set_ylim(0, 100)
    lower.set_ylabel("failed [%]")
    lower.set_xlabel("generation (0: the imitation)")
    style(lower)
    return svg(figure)


def outcomes_by_target(
    motions: Sequence[RefinedMotion], targets: FloatArray, radius_m: float, plane: tuple[int, int]
) -> str:
    """Draw where each motion ended, relative to its own target, before and after the search.

    Parameters
    ----------
    motions, targets, radius_m, plane
        As in `touchdown_map`.

    Returns
    -------
    str
        SVG; centimetres.
    """
    from matplotlib.patches import Circle

    pick = list(plane)
    before = 100 * (np.array([one.outcome_before for one in motions]) - targets)[:, pick]
    after = 100 * (np.array([one.outcome for one in motions]) - targets)[:, pick]
    figure = new_figure(5, 4)
    axes = figure.add_subplot()
    axes.add_patch(Circle((0, 0), 100 * radius_m, fill=False, color=COLOURS[2], label="success"))
    axes.plot(*before.T, "o", markerfacecolor="none", color=COLOURS[5], ms=5, label="imitated")
    axes.plot(*after.T, "o", color=COLOURS[0], markersize=4, label="refined")
    axes.axhline(0, color=INK, linewidth=0.4)
    axes.axvline(0, color=INK, linewidth=0.4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_ylabel(f"{_AXES[plane[1]]} of the target [cm]")
    return _finish(figure, axes, f"{_AXES[plane[0]]} of the target [cm]")


def _scale_by_decades(axes: Any) -> None:
    """Scale by powers of ten, with plain numbers at 1, 2 and 5."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set_yscale("log")
    low, high = axes.get_ylim()
    few = high / low < 1000
    axes.yaxis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    # Ticks without a number, dozens of them, take half as long as all the rest.
    axes.yaxis.set_minor_locator(NullLocator())


def _finish(figure: Any, axes: Any, across: str) -> str:
    axes.set_xlabel(across)
    axes.legend(fontsize=7, frameon=False, labelcolor=INK)
    style(axes)
    return svg(figure)
