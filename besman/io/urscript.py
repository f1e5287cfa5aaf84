"""Joint trajectories as programs for the arms of Universal Robots.

The program brings the arm to the start with ``movej``, slowly, straight in joint space, and then
gives it one set-point per control cycle with ``servoj``. The controller of the CB3 series (UR5,
UR10) has 125 cycles a second.

References
----------
Universal Robots: "ServoJ command", support article: arguments, their ranges, the cycle of CB3.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.io.atomic_files import write_text
from besman.records import FloatArray

CYCLE_S = 0.008
# The joints of every UR arm, in the order that URScript takes them.
UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
# The least lag that the controller offers; a greater gain follows closer and is rougher.
_LOOKAHEAD_S = 0.03
_GAIN = 500
# Rounded by less than `besman.robot.limits.check_limits` lets pass.
_DECIMALS = 10
_NUMBER = r"-?\d+\.\d+"
_START = re.compile(rf"^  movej\(\[({_NUMBER}(?:, {_NUMBER}){{5}})\]", re.MULTILINE)
_SET_POINT = re.compile(rf"^  servoj\(\[({_NUMBER}(?:, {_NUMBER}){{5}})\]", re.MULTILINE)


def write_urscript(
    path: Path,
    name: str,
    time: FloatArray,
    positions: FloatArray,
    way: FloatArray | None = None,
) -> None:
    """Write a movement as URScript.

    Parameters
    ----------
    path : Path
        File to write.
    name : str
        Of the program; what URScript does not allow in names becomes ``_``.
    time : array, shape (T,)
        Seconds, evenly spaced, a whole number of samples in 8 ms.
    positions : array, shape (T, 6)
        rad, in the order of `UR_JOINTS`; at rest at the start and at the end.
    way : array, shape (W, 6), optional
        rad; where the arm goes through on its way to the start, which is the last of them.

    Raises
    ------
    RecordingError
        If the samples do not fit the controller's cycle, or these are not six joints.
    FileError
        If it cannot be written.
    """
    every = round(CYCLE_S / float(time[1] - time[0])) if len(time) > 1 else 0
    steps = np.diff(time)
    if not every or np.any(np.abs(steps * every - CYCLE_S) > 1e-6) or positions.shape[1] != 6:
        raise RecordingError(
            f"{path}: URScript: expected six joints and samples evenly spaced within {CYCLE_S} s"
        )
    rows = list(range(every, len(time), every))
    if not rows or rows[-1] != len(time) - 1:
        # The end is a little late then; the arm is at rest there.
        rows.append(len(time) - 1)
    lines = [
        f"def besman_{re.sub(r'[^A-Za-z0-9_]', '_', name)}():",
        f"  # {len(rows)} set-points, one each {CYCLE_S * 1000:g} ms. Try it slowly first.",
        f"  lookahead_time = {_LOOKAHEAD_S:g}",
        f"  gain = {_GAIN}",
        *_approach(positions[0] if way is None else way),
        *(
            f"  servoj({_joints(positions[row])}, 0, 0, {CYCLE_S:g}, lookahead_time, gain)"
            for row in rows
        ),
        "  stopj(2.0)",
        "end",
    ]
    write_text(path, "\n".join(lines) + "\n", durable=False)


def _approach(way: FloatArray) -> list[str]:
    """Write the way to the start: one movej a place."""
    places = np.atleast_2d(way)
    lines = [f"  movej({_joints(place)}, a=0.5, v=0.5)" for place in places]
    if len(places) > 1:
        lines.insert(0, "  # From where the arm is to the first place: not checked for collisions.")
        lines.insert(2, "  # From there to the start: checked.")
    return lines


def _joints(angles: FloatArray) -> str:
    """Write six angles as URScript's list, so exactly that none at its limit is beyond it."""
    return "[" + ", ".join(f"{angle:.{_DECIMALS}f}" for angle in angles) + "]"


def read_urscript(path: Path) -> tuple[FloatArray, FloatArray]:
    """Read the set-points of `write_urscript`: time (T,) from the start, and positions (T, 6).

    Raises
    ------
    RecordingError
        If the file is no such program.
    """
    text = path.read_text(encoding="utf-8")
    start, points = _START.findall(text), _SET_POINT.findall(text)
    if not start or not points:
        raise RecordingError(f"{path}: expected movej and servoj commands of six joints")
    rows = [[float(number) for number in point.split(", ")] for point in start[-1:] + points]
    return np.arange(len(rows), dtype=np.float64) * CYCLE_S, np.array(rows, dtype=np.float64)
