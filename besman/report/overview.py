"""One demonstration from the side: the person on the left, the robot on the right."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.geometry.frames import back_frame
from besman.person.body import find_body
from besman.records import FloatArray, LabelledRecording, RefinedMotion
from besman.records.layers import Side
from besman.report.figures import COLOURS, INK, new_figure, style, svg
from besman.robot.model import Robot

_POSTURES = 8
_FLIGHT_S = 1.2


def overview(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    thrown: str | None,
    robot: Robot,
    motion: RefinedMotion,
    placement: FloatArray,
    side: Side = "right",
) -> str:
    """Draw a demonstration and the refined motion beside each other, from the person's right.

    Parameters
    ----------
    recording : LabelledRecording
        The person.
    bounds : pair of int
        First row of the demonstration and the row after its last.
    thrown : str or None
        Marker of the thrown object.
    robot : Robot
        The arm.
    motion : RefinedMotion
        What became of the demonstration.
    placement : array, shape (4, 4)
        Back frame to the robot's world frame, metres.
    side : "right" or "left"
        The person's arm that is drawn.

    Returns
    -------
    str
        SVG.
    """
    figure = new_figure(10, 4.4)
    _draw_person(figure.add_subplot(1, 2, 1), recording, bounds, thrown, side)
    _draw_robot(figure.add_subplot(1, 2, 2), robot, motion, placement)
    return svg(figure)


def _draw_person(
    axes: Any,
    recording: LabelledRecording,
    bounds: tuple[int, int],
    thrown: str | None,
    side: Side,
) -> None:
    """Draw back, shoulder, elbow and hand at some instants, and the object's flight."""
    body = find_body(recording.markers, recording.source)
    arm = next((one for one in body.arms if one.side == side), body.arms[0])
    start, stop = bounds
    rotation, origin = back_frame(*(recording.marker(name)[start] for name in body.back))
    # Height above the floor stays; only where the person stands is taken out.
    foot = origin * (1, 1, 0)
    names = (body.back[0], arm.shoulder, arm.elbow, arm.hand)
    chain = np.stack([recording.marker(name) for name in names], axis=1)
    limbs = (chain - foot) @ rotation
    for at, alpha in _instants(start, stop - 1):
        axes.plot(
            *limbs[at][:, [0, 2]].T,
            color=COLOURS[1],
            alpha=alpha,
            linewidth=2,
            marker="o",
            markersize=3,
        )
    axes.plot(*limbs[start:stop, 3][:, [0, 2]].T, color=INK, linewidth=1)
    if thrown is not None and thrown in recording.markers:
        end = stop + round(_FLIGHT_S * recording.rate_hz)
        flight = ((recording.marker(thrown) - foot) @ rotation)[start:end]
        axes.plot(*flight[:, [0, 2]].T, color=COLOURS[5], linestyle=":", linewidth=1.5)
    _finish(axes, f"person: {recording.source}")


def _draw_robot(axes: Any, robot: Robot, motion: RefinedMotion, placement: FloatArray) -> None:
    """Draw the arm at some instants, the object's flight and the target."""
    forward = placement[:3, :3].T
    for at, alpha in _instants(0, len(motion.time) - 1):
        points = _joints(robot, motion.positions[at]) @ forward.T
        axes.plot(
            points[:, 0],
            points[:, 2],
            color=COLOURS[0],
            alpha=alpha,
            linewidth=2,
            marker="o",
            markersize=3,
        )
    path = motion.tool_path @ forward.T
    axes.plot(path[:, 0], path[:, 2], color=INK, linewidth=1)
    base = forward @ robot.chain.placements[0, :3, 3]
    axes.plot([base[0], base[0]], [0, robot.base_height], color=INK, linewidth=6, alpha=0.4)
    if len(motion.object_path):
        flight = motion.object_path @ forward.T
        axes.plot(flight[:, 0], flight[:, 2], color=COLOURS[5], linestyle=":", linewidth=1.5)
    thrown = np.all(np.isfinite(motion.plan.target))
    goal = forward @ (motion.plan.target if thrown else motion.plan.goal_pose[:3])
    axes.plot(goal[0], goal[2], marker="x", color=COLOURS[2], markersize=9, markeredgewidth=2)
    axes.annotate(
        "target",
        (goal[0], goal[2]),
        fontsize=8,
        color=INK,
        xytext=(6, 6),
        textcoords="offset points",
    )
    _finish(axes, f"robot: {robot.name}, miss {100 * motion.miss:.1f} cm")


def _joints(robot: Robot, positions: FloatArray) -> FloatArray:
    """Return base, joints and tool centre point of one configuration, shape (n + 1, 3), metres."""
    # Loaded with the robot, while the compiled kinematics are not.
    import pinocchio

    data = robot.model.createData()
    pinocchio.framesForwardKinematics(robot.model, data, np.asarray(positions))
    joints = [data.oMi[index + 1].translation for index in range(robot.n)]
    return np.vstack([*joints, data.oMf[robot.tip_frame].translation])


def _instants(first: int, last: int) -> list[tuple[int, float]]:
    """Return rows evenly spread in time, and how strongly to draw them: later is stronger."""
    rows = np.linspace(first, last, _POSTURES).round().astype(int)
    return list(zip(rows.tolist(), np.linspace(0.2, 1, _POSTURES).tolist(), strict=True))


def _finish(axes: Any, title: str) -> None:
    """Give both halves the same look."""
    axes.axhline(0, color=INK, linewidth=1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("forward [m]")
    axes.set_ylabel("height [m]")
    axes.set_title(title, loc="left")
    style(axes)
