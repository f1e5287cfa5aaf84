"""The report's figures: arrays in, SVG text out. Colours are read in light and in dark."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.records import (
    FloatArray,
    JointTrajectory,
    LabelledRecording,
    LabelledSegments,
    RefinedMotion,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, distinguishable without red-green vision.
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#999999", "#f0e442")
INK = "#7a7f87"
LONGEST_CURVE = 2000
_SVG_DPI = 72


def new_figure(width: float, height: float) -> Figure:
    """Make a figure without a screen, on a transparent ground."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.patch.set_alpha(0)
    return figure


def style(axes: object) -> None:
    """Give axes the report's look."""
    axes.patch.set_alpha(0)  # type: ignore[attr-defined]
    axes.tick_params(colors=INK, labelsize=8)  # type: ignore[attr-defined]
    for side, spine in axes.spines.items():  # type: ignore[attr-defined]
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(INK)
    for label in (axes.xaxis.label, axes.yaxis.label):  # type: ignore[attr-defined]
        label.set_color(INK)
        label.set_fontsize(9)
    axes.set_title(axes.get_title(loc="left"), loc="left", color=INK, fontsize=9)  # type: ignore[attr-defined]


def svg(figure: Figure) -> str:
    """Return a figure as SVG text without a date, so that the same figure gives the same bytes."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    canvas, text = FigureCanvasSVG(figure), io.StringIO()
    with rc_context({"svg.hashsalt": "besman", "svg.fonttype": "none"}):
        _settle_layout(figure)
        canvas.print_svg(text, metadata={"Date": None})
    content = text.getvalue()
    return content[content.index("<svg") :]


def _settle_layout(figure: Figure) -> None:
    """Place a figure's parts for good; `Figure.savefig` would draw all of them for that too."""
    engine, dots_per_inch = figure.get_layout_engine(), figure.dpi
    if engine is None:
        return
    figure.dpi = _SVG_DPI
    engine.execute(figure)
    figure.dpi = dots_per_inch
    figure.set_layout_engine("none")


def draw_lines(axes: Axes, lines: Sequence[FloatArray], **look: Any) -> None:
    """Draw lines (N, 2) that look alike: all at once, each by itself takes ten times as long."""
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(lines, capstyle="projecting", **look))
    axes.autoscale_view()


def label_colours(labels: Sequence[str]) -> dict[str, str]:
    """Give every label a colour, the same for the same set of labels."""
    names = sorted(set(labels))
    return {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(names)}


def speed_profile(
    recording: LabelledRecording,
    found: LabelledSegments,
    manual: LabelledSegments | None,
    marker: str,
    colours: dict[str, str],
) -> str:
    """Draw the hand's speed with the found segments and, below, the manual ones.

    Parameters
    ----------
    recording : LabelledRecording
        Where the speed is taken from.
    found : LabelledSegments
        Segments with labels.
    manual : LabelledSegments or None
        Truth, if there is one.
    marker : str
        Whose speed.
    colours : dict
        Colour of each label.

    Returns
    -------
    str
        SVG.
    """
    figure = new_figure(10, 2.6)
    axes = figure.add_subplot()
    time = recording.time - recording.time[0]
    speed = np.linalg.norm(np.gradient(recording.marker(marker), time, axis=0), axis=1)
    window = max(1, round(0.03 * recording.rate_hz))
    speed = np.convolve(speed, np.ones(window) / window, mode="same")
    step = max(1, len(time) // LONGEST_CURVE)
    axes.plot(time[::step], speed[::step], color=INK, linewidth=0.9)
    top = float(np.max(speed)) if len(speed) else 1.0
    low, high = -0.16 * top if manual is not None else 0.0, 1.05 * top
    spans = _spans(found, time)
    _shade(axes, spans, (low, high), colours, 0.35)
    axes.vlines([start for start, _, _ in spans], low, high, color=INK, linewidth=0.5)
    _shade(axes, _spans(manual, time), (-0.14 * top, -0.04 * top), colours, 1.0)
    if manual is not None:
        axes.text(time[-1], -0.1 * top, " manual", fontsize=7, color=INK, va="center")
    axes.set_xlim(0, time[-1])
    axes.set_ylim(low, high)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"speed of {marker} [m/s]")
    axes.set_title(recording.source, loc="left")
    style(axes)
    return svg(figure)


def _spans(segments: LabelledSegments | None, time: FloatArray) -> list[tuple[float, float, str]]:
    """Return start, end (s) and label of every segment."""
    if segments is None:
        return []
    last = len(time) - 1
    return [
        (time[min(start, last)], time[min(stop, last)], label)
        for (start, stop), label in zip(segments.bounds, segments.labels, strict=True)
    ]


def _shade(
    axes: Axes,
    spans: Sequence[tuple[float, float, str]],
    between: tuple[float, float],
    colours: dict[str, str],
    alpha: float,
) -> None:
    """Shade spans of time between two heights, all at once: see `draw_lines`."""
    from matplotlib.collections import PolyCollection

    low, high = between
    corners = [[(a, low), (a, high), (b, high), (b, low)] for a, b, _ in spans]
    shades = [colours[label] for _, _, label in spans]
    axes.add_collection(PolyCollection(corners, facecolors=shades, alpha=alpha, linewidths=0))


def time_line(
    layers: Sequence[tuple[str, LabelledSegments]], colours: dict[str, str], title: str
) -> str:
    """Draw layers of segments above each other: building blocks below, actions above.

    Parameters
    ----------
    layers : sequence of (str, LabelledSegments)
        Name and segments of each layer, the lowest first.
    colours : dict
        Colour of each label.
    title : str

    Returns
    -------
    str
        SVG.
    """
    figure = new_figure(10, 0.7 + 0.42 * len(layers))
    axes = figure.add_subplot()
    for height, (_, layer) in enumerate(layers):
        for (start, end), label in zip(layer.bounds / layer.rate_hz, layer.labels, strict=True):
            axes.barh(
                height,
                end - start,
                left=start,
                height=0.8,
                color=colours[label],
                alpha=0.55,
                edgecolor=INK,
                linewidth=0.5,
            )
            axes.text(
                0.5 * (start + end),
                height,
                label.replace("_", "\n", 1),
                fontsize=6,
                color=INK,
                ha="center",
                va="center",
                clip_on=True,
            )
    axes.set_yticks(range(len(layers)), [name for name, _ in layers])
    axes.set_xlim(0, max(layer.bounds.max() / layer.rate_hz for _, layer in layers))
    axes.set_xlabel("time [s]")
    axes.set_title(title, loc="left")
    style(axes)
    return svg(figure)


def paths(
    trajectories: Sequence[JointTrajectory], motions: Sequence[RefinedMotion], up: int = 2
) -> str:
    """Draw demonstrated and executed paths of the tool.

    Parameters
    ----------
    trajectories : sequence of JointTrajectory
        What was mapped.
    motions : sequence of RefinedMotion
        What became of it.
    up : int
        Which coordinate to draw over x: 2 from the side, 1 from above.

    Returns
    -------
    str
        SVG; robot's world frame, metres.
    """
    figure = new_figure(5, 4)
    axes = figure.add_subplot()
    shown = [one.poses[:, [0, up]] for one in trajectories]
    draw_lines(axes, shown, color=COLOURS[1], linewidth=1)
    shown = [one.tool_path[:: max(1, len(one.tool_path) // 200), [0, up]] for one in motions]
    draw_lines(axes, shown, color=COLOURS[0], linewidth=0.8, alpha=0.8)
    axes.plot(0, 0, marker="s", color=INK, markersize=6)
    axes.annotate(
        "robot's base", (0, 0), fontsize=7, color=INK, xytext=(6, 4), textcoords="offset points"
    )
    axes.plot([], [], color=COLOURS[1], label="demonstrated, placed")
    axes.plot([], [], color=COLOURS[0], label="robot, refined")
    axes.legend(fontsize=7, frameon=False, labelcolor=INK)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x forward [m]")
    axes.set_ylabel("z up [m]" if up == 2 else "y left [m]")
    style(axes)
    return svg(figure)
