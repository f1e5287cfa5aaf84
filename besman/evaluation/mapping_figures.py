"""Demonstrations in the workspaces of the arms, like figure 7.5 (a, b) of the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.evaluation.mapping import Transferred
from besman.evaluation.mapping_data import subject_of
from besman.io.atomic_files import make_folder, written_aside
from besman.report.figures import COLOURS
from besman.robot.kinematics import fill_frames, forward_kinematics
from besman.robot.model import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]

_ARM = "#d4d9e1"
_INK = "#3c4048"
_DPI = 150
_MOST_LINES = 800  # of one panel; more make a blot
_ROUND, _ALONG = 14, 5  # facets of a capsule
_FIFTH = 4
_VIEW = (22.0, -62.0)  # elevation and azimuth, degrees
_LIGHT = np.array([0.25, -0.75, 0.6])
_PEDESTAL_M = 0.25


def write_mapping_figures(mapped: Sequence[Transferred], folder: Path) -> list[Path]:
    """Draw every class in the workspaces of all robots, and how errors and times are spread.

    Parameters
    ----------
    mapped : sequence of Transferred
        Of `besman.evaluation.mapping.evaluate_mapping`.
    folder : Path
        Made if need be.

    Returns
    -------
    list of Path
        PNG files: ``CLASS_workspaces.png`` (colours: subjects), ``CLASS_subject.png`` (one
        subject, colours: order) and ``CLASS_spread.png``; the dataset's name in front.
    """
    make_folder(folder)
    groups: dict[tuple[str, str], list[Transferred]] = {}
    for one in mapped:
        if one.trajectories:
            groups.setdefault((one.data.dataset, one.data.label), []).append(one)
    written = []
    for (dataset, label), group in groups.items():
        subject = _chosen_subject(group)
        drawn = {
            "workspaces": draw_workspaces(group),
            "subject": draw_workspaces(group, subject),
            "spread": draw_spread(group),
        }
        for name, figure in drawn.items():
            stem = f"{dataset}_{label}_{name}".replace(" ", "_").replace("(", "").replace(")", "")
            written.append(folder / f"{stem}.png")
            with written_aside(written[-1]) as temporary:
                figure.savefig(temporary, dpi=_DPI, metadata={"Software": None})
    return written


def _subjects(group: Sequence[Transferred]) -> list[str]:
    """Return who made the demonstrations, in their order."""
    names = [hand.name for one in group for hand in one.data.demonstrations]
    return list(dict.fromkeys(subject_of(name) for name in names))


def _chosen_subject(group: Sequence[Transferred]) -> str:
    """Return the fifth subject, as the thesis does, or the last if there are fewer."""
    subjects = _subjects(group)
    return subjects[min(_FIFTH, len(subjects) - 1)]


def draw_workspaces(group: Sequence[Transferred], subject: str | None = None) -> Figure:
    """Draw the tool's paths in the workspace of every robot, all panels to one scale.

    Parameters
    ----------
    group : sequence of Transferred
        One class on several robots.
    subject : str, optional
        Draw the demonstrations of this subject alone, coloured by their order; else all,
        coloured by subject.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    columns = min(len(group), 2)
    rows = -(-len(group) // columns)
    height = 3.9 * rows + 1.2
    figure = Figure(figsize=(4.7 * columns, height))
    paths = [_tool_paths(one, subject) for one in group]
    low, high = _limits(group, [path for own in paths for path, _ in own])
    for index, (one, own) in enumerate(zip(group, paths, strict=True)):
        axes: Any = figure.add_subplot(rows, columns, index + 1, projection="3d")
        axes.computed_zorder = False
        _draw_arm(axes, one.robot, low[2])
        _draw_paths(axes, own, _colours(group, subject, one))
        _finish_panel(axes, low, high, _panel_title(one, own, subject))
    figure.subplots_adjust(
        left=0.01, right=0.96, top=1 - 0.55 / height, bottom=0.8 / height, wspace=0.02, hspace=0.08
    )
    data = group[0].data
    who = "all subjects" if subject is None else subject
    figure.suptitle(
        f"{data.label.replace('_', ' ')}, {who}: paths of the tool in the arms' workspaces "
        f"({data.dataset}, {data.source})",
        fontsize=11,
        color=_INK,
        y=1 - 0.2 / height,
    )
    _add_key(figure, group, subject)
    return figure


def _tool_paths(one: Transferred, subject: str | None) -> list[tuple[FloatArray, str]]:
    """Return path (T, 3) and name of the demonstrations, or evenly spread ones if too many."""
    chosen = [
        trajectory
        for trajectory in one.trajectories
        if subject is None or subject_of(trajectory.name) == subject
    ]
    chosen = chosen[:: max(1, -(-len(chosen) // _MOST_LINES))]
    return [
        (forward_kinematics(one.robot.chain, each.positions)[:, :3, 3], each.name)
        for each in chosen
    ]


def _colours(group: Sequence[Transferred], subject: str | None, one: Transferred) -> dict[str, Any]:
    """Return the colour of each demonstration by its name, the same on every robot."""
    names = [hand.name for hand in one.data.demonstrations]
    if subject is None:
        subjects = _subjects(group)
        return {name: COLOURS[subjects.index(subject_of(name)) % len(COLOURS)] for name in names}
    own = [name for name in names if subject_of(name) == subject]
    colours = _order_colours()(np.linspace(0.0, 1.0, max(len(own), 2)))
    return dict(zip(own, colours, strict=False))


def _order_colours() -> Any:
    from matplotlib import colormaps

    return colormaps["plasma"].resampled(256)


def _draw_paths(axes: Any, paths: list[tuple[FloatArray, str]], colours: dict[str, Any]) -> None:
    """Draw paths, many of them thinly; a dot marks where each ends."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    if not paths:
        return
    width, alpha = (0.35, 0.6) if len(paths) > 150 else (0.8, 0.8)
    # In an order of chance, so that no subject or part of a session covers the others.
    paths = [paths[row] for row in np.random.default_rng(0).permutation(len(paths))]
    own = [colours[name] for _, name in paths]
    lines = Line3DCollection(
        [path for path, _ in paths], colors=own, linewidths=width, alpha=alpha, zorder=3
    )
    axes.add_collection3d(lines, autolim=False)
    ends = np.array([path[-1] for path, _ in paths])
    axes.scatter(
        *ends.T,
        c=own,
        s=2 if len(paths) > 150 else 4,
        alpha=alpha,
        linewidths=0,
        depthshade=False,
        zorder=4,
    )


def _draw_arm(axes: Any, robot: Robot, floor: float) -> None:
    """Draw the arm's capsules at home, and its base's frame."""
    from matplotlib.colors import to_rgb
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    facets = np.concatenate([_facets(ends, radius) for ends, radius in _capsules(robot, floor)])
    normals = np.cross(facets[:, 2] - facets[:, 0], facets[:, 3] - facets[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    bright = 0.7 + 0.3 * np.clip(normals @ _LIGHT, 0.0, 1.0)
    colours = np.clip(np.outer(bright, to_rgb(_ARM)), 0.0, 1.0)
    arm = Poly3DCollection(facets, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=2)
    axes.add_collection3d(arm, autolim=False)
    base = robot.chain.placements[0, :3, 3] * (1, 1, 0) + (0, 0, robot.base_height)
    turn = robot.chain.placements[0, :3, :3]
    for axis, colour in enumerate((COLOURS[5], COLOURS[2], COLOURS[0])):
        tip = base + 0.25 * turn[:, axis]
        axes.plot(*np.stack([base, tip]).T, color=colour, linewidth=1.6, zorder=5)


def _capsules(robot: Robot, floor: float) -> list[tuple[FloatArray, float]]:
    """Return ends (2, 3) and radius of the capsules at home, as far as they are above a height."""
    chain, n = robot.chain, robot.n
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    fill_frames(chain.placements, chain.axes, np.array(robot.home), rotations, origins)
    placed = []
    for joint, ends, radius in zip(
        chain.capsule_joints, chain.capsule_ends, chain.capsule_radii, strict=True
    ):
        world = np.array(ends if joint < 0 else ends @ rotations[joint].T + origins[joint])
        if joint < 0:
            world[:, 2] = np.maximum(world[:, 2], floor + radius)
        placed.append((world, float(radius)))
    return placed


def _facets(ends: FloatArray, radius: float) -> FloatArray:
    """Return a capsule's surface as quadrilaterals, shape (F, 4, 3), metres."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    axis = along / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    first = np.linalg.svd(axis[None])[2][1]
    turn = np.linspace(0.0, 2 * np.pi, _ROUND)
    circle = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), np.cross(axis, first))
    rings = np.array(
        [
            end + radius * (np.sin(angle) * axis + np.cos(angle) * circle)
            for end, low, high in ((ends[0], -np.pi / 2, 0.0), (ends[1], 0.0, np.pi / 2))
            for angle in np.linspace(low, high, _ALONG)
        ]
    )
    corners = (rings[:-1, :-1], rings[:-1, 1:], rings[1:, 1:], rings[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def _limits(
    group: Sequence[Transferred], paths: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box around everything that is drawn in any panel, metres.

    Of the pedestals no more is shown than there is beside the lowest path.
    """
    floor = min(one.robot.base_height for one in group) - _PEDESTAL_M
    floor = max(0.0, min([floor, *(float(path[:, 2].min()) for path in paths)]))
    ends = [
        np.concatenate([ends - radius, ends + radius])
        for one in group
        for ends, radius in _capsules(one.robot, floor)
    ]
    points = np.concatenate([*paths, *ends])
    low, high = np.floor(10 * points.min(axis=0)) / 10, np.ceil(10 * points.max(axis=0)) / 10
    return low, high


def _finish_panel(axes: Any, low: FloatArray, high: FloatArray, title: str) -> None:
    """Give a panel equal axes with units, and its title."""
    from matplotlib.ticker import MultipleLocator

    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_zlim(low[2], high[2])
    axes.set_box_aspect(high - low, zoom=1.1)
    axes.view_init(*_VIEW)
    axes.set_proj_type("ortho")
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), ("x", "y", "z"), strict=True):
        axis.set_major_locator(MultipleLocator(0.5))
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color("#9aa0a8")
        axis.set_tick_params(labelsize=7, colors=_INK, pad=-1)
        axis.set_label_text(f"{name} [m]", fontsize=8, color=_INK)
        axis.labelpad = -4
        axis._axinfo["grid"].update(color="#e3e5e8", linewidth=0.5)
    axes.set_title(title, fontsize=9, color=_INK, y=1.0)


def _panel_title(one: Transferred, paths: list[tuple[FloatArray, str]], subject: str | None) -> str:
    """Name the robot and say how many of the demonstrations it can do."""
    names = [hand.name for hand in one.data.demonstrations]
    n = one.data.n if subject is None else sum(subject_of(name) == subject for name in names)
    n_moved = len(one.trajectories) if subject is None else len(paths)
    return f"{one.robot.name}: {n_moved} of {n}"


def _add_key(figure: Figure, group: Sequence[Transferred], subject: str | None) -> None:
    """Say below the panels what the colours mean."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    names = [hand.name for hand in group[0].data.demonstrations]
    height = figure.get_figheight()
    if subject is None:
        subjects = _subjects(group)
        counts = {one: sum(subject_of(name) == one for name in names) for one in subjects}
        handles = [
            Line2D([], [], color=COLOURS[index % len(COLOURS)], label=f"{one} ({counts[one]})")
            for index, one in enumerate(subjects)
        ]
        figure.legend(
            handles=handles, loc="lower center", ncols=min(len(handles), 8), fontsize=8,
            frameon=False, labelcolor=_INK, bbox_to_anchor=(0.5, 0.35 / height),
            columnspacing=1.2, handlelength=1.4,
        )  # fmt: skip
    else:
        n = sum(subject_of(name) == subject for name in names)
        place = figure.add_axes((0.36, 0.62 / height, 0.28, 0.09 / height))
        colours = ScalarMappable(Normalize(1, max(n, 2)), _order_colours())
        bar = figure.colorbar(colours, cax=place, orientation="horizontal")
        bar.set_label("number of the demonstration", fontsize=8, color=_INK, labelpad=1)
        bar.locator = MaxNLocator(integer=True)
        bar.ax.tick_params(labelsize=7, colors=_INK)
        bar.outline.set_visible(False)
    figure.text(
        0.5, 0.1 / height,
        "arms at home, drawn as their collision capsules; base frames: x red, y green, z blue; "
        "dots: where a path ends; all panels to one scale, z above the floor",
        ha="center", fontsize=7, color=_INK,
    )  # fmt: skip


def draw_spread(group: Sequence[Transferred]) -> Figure:
    """Draw how greatest position errors and time stretches are spread over demonstrations.

    Parameters
    ----------
    group : sequence of Transferred
        One class on several robots.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    figure = Figure(figsize=(8, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for index, one in enumerate(group):
        colour = COLOURS[index % len(COLOURS)]
        shares = np.arange(1, len(one.trajectories) + 1) / one.data.n
        errors = np.sort([1000 * each.position_error.max() for each in one.trajectories])
        stretch = np.sort([each.time_stretch for each in one.trajectories])
        for axes, values in ((left, np.maximum(errors, 1e-3)), (right, stretch)):
            axes.step(values, 100 * shares, where="post", color=colour, label=one.robot.name)
    left.set_xscale("log")
    left.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    left.set_xlabel("greatest position error [mm]")
    right.set_xlabel("duration over the person's")
    left.set_ylabel("demonstrations up to here [%]")
    for axes in (left, right):
        axes.set_ylim(0, 101)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e3e5e8", linewidth=0.5)
    right.legend(fontsize=8, frameon=False, loc="lower right")
    data = group[0].data
    figure.suptitle(f"{data.label.replace('_', ' ')} ({data.dataset}, {data.source})", fontsize=10)
    return figure
