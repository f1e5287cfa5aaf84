"""Figures of an arm by itself: at home, and where its hand comes."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.records import FloatArray
from besman.report.figures import COLOURS, INK, new_figure, style, svg
from besman.robot.model import Robot
from besman.robot.workspace import Workspace
from besman.view.arm_drawing import arm_surface, project

# From the right side and from ahead: the arm looks along x.
_SIDE, _AHEAD = np.array([0.0, 1.0, 0.0]), np.array([-0.8, 0.55, -0.35])
_DPI = 150
_CELLS = 26


def home_figure(robot: Robot, space: Workspace) -> str:
    """Draw an arm in its home, from its right side with its reach, and from ahead.

    Parameters
    ----------
    robot : Robot
    space : Workspace

    Returns
    -------
    str
        SVG.
    """
    from matplotlib.patches import Circle

    surface = arm_surface(robot, robot.home)
    figure = new_figure(9.6, 4.2)
    figure.dpi = _DPI
    side, ahead = figure.subplots(1, 2)
    _draw(side, *project(surface, _SIDE))
    middle = (space.shoulder[0], space.shoulder[2])
    side.add_patch(
        Circle(middle, space.reach_m, fill=False, color=COLOURS[0], linestyle=":", linewidth=1.2)
    )
    side.axhline(0.0, color=INK, linewidth=1.0)
    side.set_xlim(middle[0] - 1.1 * space.reach_m, middle[0] + 1.1 * space.reach_m)
    side.set_ylim(min(-0.02, middle[1] - 1.1 * space.reach_m), middle[1] + 1.1 * space.reach_m)
    side.set_xlabel("forward [m]")
    side.set_ylabel("height [m]")
    side.set_title("from the side; dotted: reach", loc="left")
    style(side)
    _draw(ahead, *project(surface, _AHEAD))
    ahead.autoscale_view()
    ahead.set_title("from ahead, above", loc="left")
    style(ahead)
    ahead.set_axis_off()
    return svg(figure)


def _draw(axes: Any, corners: FloatArray, colours: FloatArray) -> None:
    """Draw triangles in their order."""
    from matplotlib.collections import PolyCollection

    faces = PolyCollection(
        list(corners), facecolors=colours, edgecolors=colours, linewidths=0.3, rasterized=True
    )
    axes.add_collection(faces)
    axes.set_aspect("equal")


def workspace_figure(space: Workspace, robot: Robot) -> str:
    """Draw in which parts of its workspace an arm is free, touches something, or is singular.

    Parameters
    ----------
    space : Workspace
    robot : Robot

    Returns
    -------
    str
        SVG: cells of distance from the first axis and height, each with the share of poses.
    """
    base = robot.chain.placements[0][:3, 3]
    away = np.hypot(space.points[:, 0] - base[0], space.points[:, 1] - base[1])
    height = space.points[:, 2]
    edges = (
        np.linspace(0.0, float(away.max()) + 1e-9, _CELLS + 1),
        np.linspace(float(height.min()), float(height.max()) + 1e-9, _CELLS + 1),
    )
    everything = np.histogram2d(away, height, bins=edges)[0]
    clear = ~space.touching
    parts = (
        ("touching itself, its pedestal or the floor", space.touching, everything),
        (
            "singular or next to it, where clear",
            space.singular & clear,
            np.histogram2d(away[clear], height[clear], bins=edges)[0],
        ),
    )
    figure = new_figure(9.6, 3.6)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (title, chosen, whole) in zip(panels, parts, strict=True):
        found = np.histogram2d(away[chosen], height[chosen], bins=edges)[0]
        share = np.full_like(found, np.nan)
        np.divide(found, whole, out=share, where=whole > 0)
        picture = axes.pcolormesh(
            *edges, share.T, vmin=0.0, vmax=1.0, cmap="cividis_r", rasterized=True
        )
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_aspect("equal")
        axes.set_xlabel("distance from the first axis [m]")
        axes.set_title(title, loc="left")
        style(axes)
    panels[0].set_ylabel("height [m]")
    bar = figure.colorbar(picture, ax=panels, shrink=0.85)
    bar.set_label("share of poses", color=INK, fontsize=9)
    bar.ax.tick_params(colors=INK, labelsize=8)
    bar.outline.set_edgecolor(INK)
    return svg(figure)
