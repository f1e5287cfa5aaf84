"""Closed-form inverse kinematics of arms built like the UR series: all eight branches of a pose.

The arm has six joints; joints 2, 3 and 4 are parallel, and axes 5 and 6 meet. Both are read off the
chain, not off a name, and nothing else is assumed: neither right angles nor a Denavit-Hartenberg
frame. What follows the last joint is constant.

References
----------
K. P. Hawkins: Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms, 2013 (the order
of the joints). R. M. Murray, Z. Li, S. S. Sastry: A mathematical introduction to robotic
manipulation, 1994, section 3.2 (axes at zero angles, products of exponentials).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.axis_turns import SINGULAR, dot_product, rotate, turn_between, turn_to_height
from besman.robot.kinematics import compiled
from besman.robot.parts import Chain

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

N_BRANCHES = 8
_PARALLEL = 1e-6
_MEET_M = 1e-6
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class UrGeometry:
    """The axes of the arm in the world when all angles are zero.

    Attributes
    ----------
    axes : array, shape (6, 3)
        Unit vectors.
    points : array, shape (6, 3)
        A point on each axis, metres; of joints 5 and 6 the one where they meet.
    tip : array, shape (4, 4)
        Pose of the tool centre point, metres.
    """

    axes: FloatArray
    points: FloatArray
    tip: FloatArray


def read_geometry(chain: Chain) -> UrGeometry | None:
    """Read the axes off a chain; None if the arm is not built like the UR series.

    Parameters
    ----------
    chain : Chain
        The arm.
    """
    if len(chain.axes) != 6:
        return None
    axes, points, pose = np.empty((6, 3)), np.empty((6, 3)), np.eye(4)
    for joint in range(6):
        pose = pose @ chain.placements[joint]
        axes[joint], points[joint] = pose[:3, :3] @ chain.axes[joint], pose[:3, 3]
    along = axes[1]
    parallel = all(np.linalg.norm(np.cross(along, axes[j])) < _PARALLEL for j in (2, 3))
    # The base must move the parallel axes, and joint 5 the last axis.
    crossing = all(
        np.linalg.norm(np.cross(axes[a], axes[b])) > 0.1 for a, b in ((0, 1), (3, 4), (4, 5))
    )
    links = [points[2] - points[1], points[3] - points[2]]
    flat = [np.linalg.norm(np.cross(along, link)) for link in links]
    if not (parallel and crossing and min(flat) > 1e-3):
        return None
    normal = np.cross(axes[4], axes[5])
    apart = points[5] - points[4]
    if abs(apart @ normal) / np.linalg.norm(normal) > _MEET_M:
        return None
    shift = np.cross(apart, axes[5]) @ normal / (normal @ normal)
    points[4] = points[5] = points[4] + shift * axes[4]
    return UrGeometry(axes, points, pose @ chain.tip)


def solve_branches(
    geometry: UrGeometry,
    targets: npt.ArrayLike,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Find all eight configurations of every pose of a path.

    Parameters
    ----------
    geometry : UrGeometry
    targets : array, shape (T, 4, 4)
        Poses of the tool centre point in the world, metres.
    low, high : array, shape (6,)
        Limits of the joints, rad.
    home : array, shape (6,)
        Of the angles that differ by full turns the one nearest to it is taken, rad.

    Returns
    -------
    positions : array, shape (T, 8, 6)
        rad; a joint that the pose leaves open (singular) is as in the pose before or, at the
        beginning of the path, as in the pose after.
    valid : bool array, shape (T, 8)
        The branch reaches the pose within the limits.
    """
    poses = np.array(targets, dtype=np.float64, order="C").reshape(-1, 4, 4)
    return _solve_path(
        np.array(geometry.axes),
        np.array(geometry.points),
        np.array(geometry.tip),
        poses,
        np.array(low),
        np.array(high),
        np.array(home),
    )


@compiled
def _solve_elbow(
    axes: FloatArray,
    points: FloatArray,
    wrist: FloatArray,
    total: float,
    elbow: int,
    nearby: FloatArray,
    work: FloatArray,
    answer: FloatArray,
) -> tuple[bool, bool]:
    """Find joints 2, 3 and 4 from the wrist's place and their total turn; say valid, singular.

    `wrist` and `total` are seen after joint 1 is turned back; `work` has shape (5, 3).
    """
    along = axes[1]
    upper, lower, place, arm, offset = work[0], work[1], work[2], work[3], work[4]
    for k in range(3):
        offset[k] = points[5, k] - points[3, k]
    rotate(along, total, offset, place)
    for k in range(3):
        place[k] = wrist[k] - place[k] - points[1, k]
        upper[k] = points[2, k] - points[1, k]
        lower[k] = points[3, k] - points[2, k]
    shift = dot_product(upper, along)
    reach = dot_product(place, along)
    depth = dot_product(lower, along)
    for k in range(3):
        upper[k] -= shift * along[k]
        place[k] -= reach * along[k]
        lower[k] -= depth * along[k]
    height = 0.5 * (
        dot_product(place, place) - dot_product(upper, upper) - dot_product(lower, lower)
    )
    first, second, state = turn_to_height(along, lower, upper, height)
    if state < 1:
        return False, False
    bend = first if elbow == 0 else second
    rotate(along, bend, lower, arm)
    for k in range(3):
        arm[k] += upper[k]
    swing, size = turn_between(along, arm, place)
    singular = size < SINGULAR
    signs = (1.0, np.sign(dot_product(along, axes[2])), np.sign(dot_product(along, axes[3])))
    if singular:
        swing = nearby[1]
    answer[1] = swing
    answer[2] = signs[1] * bend
    answer[3] = signs[2] * (total - swing - bend)
    return True, singular


@compiled
def _total_turn(axes: FloatArray, turn: FloatArray, answer: FloatArray, work: FloatArray) -> float:
    """Return the sum of the turns of joints 2, 3 and 4 from the angles of joints 1, 5 and 6."""
    along, across, first, second = axes[1], work[5], work[2], work[6]
    least = 0
    for k in range(3):
        if abs(along[k]) < abs(along[least]):
            least = k
    for k in range(3):
        across[k] = -along[least] * along[k]
    across[least] += 1.0
    # Backwards through joints 5 and 6, forwards with the tool, backwards through joint 1.
    rotate(axes[4], -answer[4], across, first)
    rotate(axes[5], -answer[5], first, second)
    for k in range(3):
        first[k] = turn[k, 0] * second[0] + turn[k, 1] * second[1] + turn[k, 2] * second[2]
    rotate(axes[0], -answer[0], first, second)
    angle, _ = turn_between(along, across, second)
    return float(angle)


@compiled
def _solve_wrist(
    axes: FloatArray,
    points: FloatArray,
    turn: FloatArray,
    wrist: FloatArray,
    branch: int,
    nearby: FloatArray,
    work: FloatArray,
    answer: FloatArray,
) -> tuple[bool, bool]:
    """Write joints 1, 5 and 6 of a branch into `answer`; return whether valid, and singular.

    Parameters
    ----------
    axes, points : array
        As in `UrGeometry`.
    turn : array, shape (3, 3)
        The tool's rotation from where all angles are zero.
    wrist : array, shape (3,)
        Where axes 5 and 6 shall meet, metres.
    branch : int
        Bits: shoulder, wrist.
    nearby : array, shape (6,)
        Taken for joints that the pose leaves open, rad.
    work : array, shape (12, 3)
        Overwritten; row 4 is the wrist's place seen with joint 1 turned back.
    answer : array, shape (6,)
        Written, rad.
    """
    along, away, side, seen, vector, back = axes[1], work[0], work[1], work[2], work[3], work[4]
    for k in range(3):
        away[k] = wrist[k] - points[0, k]
    height = dot_product(points[5], along) - dot_product(points[0], along)
    first, second, state = turn_to_height(axes[0], away, along, height)
    if state == 0:
        return False, False
    singular = state < 0
    # The angle turns the wrist back into the plane: joint 1 turns the plane to the wrist.
    answer[0] = nearby[0] if singular else (-first if branch & 1 == 0 else -second)
    rotate(axes[0], -answer[0], away, back)
    for k in range(3):
        back[k] += points[0, k]
    rotate(axes[0], answer[0], along, side)
    for k in range(3):
        seen[k] = turn[0, k] * side[0] + turn[1, k] * side[1] + turn[2, k] * side[2]
    first, second, state = turn_to_height(axes[4], axes[5], along, dot_product(axes[5], seen))
    if state < 1:
        return False, False
    answer[4] = first if branch & 2 == 0 else second
    rotate(axes[4], -answer[4], along, vector)
    answer[5], size = turn_between(axes[5], seen, vector)
    if size < SINGULAR:
        singular = True
        answer[5] = nearby[5]
    return True, singular


@compiled
def _reach_elbow(
    axes: FloatArray, points: FloatArray, total: float, answer: FloatArray, work: FloatArray
) -> float:
    """Change an open joint 6 until joints 2 and 3 reach; return the total turn that goes with it.

    Where axis 6 is parallel to joints 2 to 4, joint 6 turns against them; `work` as `_solve_wrist`
    left it.
    """
    along, vector, wrist, offset, place, link = axes[1], work[3], work[4], work[7], work[8], work[9]
    _, size = turn_between(axes[5], along, vector)
    if size >= SINGULAR:
        return total
    lengths = np.zeros(4)
    for k in range(3):
        offset[k] = points[5, k] - points[3, k]
        place[k] = wrist[k] - points[1, k]
    for which in range(4):
        for k in range(3):
            if which >= 2:
                link[k] = points[which, k] - points[which - 1, k]
            else:
                link[k] = offset[k] if which == 0 else place[k]
        lengths[which] = np.sqrt(max(dot_product(link, link) - dot_product(link, along) ** 2, 0.0))
    if lengths[0] * lengths[1] < SINGULAR:
        return total
    toward, _ = turn_between(along, offset, place)
    double = 2.0 * lengths[0] * lengths[1]
    shared = lengths[0] ** 2 + lengths[1] ** 2
    distance = np.sqrt(max(shared - double * np.cos(total - toward), 0.0))
    least, most = abs(lengths[2] - lengths[3]), lengths[2] + lengths[3]
    if least <= distance <= most:
        return total
    wanted = most if distance > most else least
    away = np.arccos(min(max((shared - wanted**2) / double, -1.0), 1.0))
    off = total - toward - _TURN * np.rint((total - toward) / _TURN)
    changed = toward + (away if off > 0.0 else -away)
    answer[5] += np.sign(dot_product(axes[5], vector)) * (total - changed)
    return float(changed)


@compiled
def _fit(angles: FloatArray, low: FloatArray, high: FloatArray, near: FloatArray) -> bool:
    """Shift angles by full turns next to `near` within the limits; return whether that is so."""
    for j in range(len(angles)):
        angle = angles[j] - _TURN * np.rint((angles[j] - near[j]) / _TURN)
        if angle < low[j]:
            angle += _TURN * np.ceil((low[j] - angle) / _TURN)
        elif angle > high[j]:
            angle -= _TURN * np.ceil((angle - high[j]) / _TURN)
        angles[j] = angle
        if angle < low[j] or angle > high[j]:
            return False
    return True


@compiled
def _find_meeting(points: FloatArray, tip: FloatArray) -> FloatArray:
    """Return where axes 5 and 6 meet, seen from the tool, shape (3,)."""
    meeting = np.zeros(3)
    for k in range(3):
        for row in range(3):
            meeting[k] += tip[row, k] * (points[5, row] - tip[row, 3])
    return meeting


@compiled
def _see_target(
    target: FloatArray, tip: FloatArray, meeting: FloatArray, turn: FloatArray, wrist: FloatArray
) -> None:
    """Write the tool's rotation from where all angles are zero, and where axes 5, 6 shall meet."""
    for row in range(3):
        wrist[row] = target[row, 3]
        for k in range(3):
            wrist[row] += target[row, k] * meeting[k]
            turn[row, k] = 0.0
            for column in range(3):
                turn[row, k] += target[row, column] * tip[k, column]


@compiled
def _look_beside(
    positions: FloatArray,
    valid: BoolArray,
    singular: BoolArray,
    beside: int,
    branch: int,
    home: FloatArray,
) -> tuple[FloatArray, bool]:
    """Return what a branch should be near to, and whether the pose beside tells open joints."""
    if not 0 <= beside < len(positions):
        return home, False
    for one in range(branch, branch + 2):
        if valid[beside, one]:
            return positions[beside, one], not singular[beside, branch >> 1]
    return home, False


@compiled
def _solve_path(
    axes: FloatArray,
    points: FloatArray,
    tip: FloatArray,
    targets: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Solve every pose for its eight branches; see `solve_branches`."""
    n_poses = len(targets)
    positions, valid = np.empty((n_poses, N_BRANCHES, 6)), np.zeros((n_poses, N_BRANCHES), np.bool_)
    singular, answer = np.zeros((n_poses, N_BRANCHES // 2), np.bool_), np.empty(6)
    turn, wrist, work = np.empty((3, 3)), np.empty(3), np.empty((12, 3))
    meeting = _find_meeting(points, tip)
    for step in range(2 * n_poses):
        # Forwards; then backwards over what is singular at the beginning.
        index = step if step < n_poses else 2 * n_poses - 1 - step
        beside = index - 1 if step < n_poses else index + 1
        if step >= n_poses and not np.any(singular[index]):
            continue
        _see_target(targets[index], tip, meeting, turn, wrist)
        for branch in range(0, N_BRANCHES, 2):
            near, told = _look_beside(positions, valid, singular, beside, branch, home)
            if step >= n_poses and not (singular[index, branch >> 1] and told):
                continue
            found, is_open = _solve_wrist(
                axes, points, turn, wrist, branch >> 1, near, work, answer
            )
            total = _total_turn(axes, turn, answer, work) if found else 0.0
            if found and is_open:
                total = _reach_elbow(axes, points, total, answer, work)
            for elbow in range(2):
                one = positions[index, branch + elbow]
                for j in range(6):
                    one[j] = answer[j]
                bends, folded = False, False
                if found:
                    bends, folded = _solve_elbow(
                        axes, points, work[4], total, elbow, near, work[7:12], one
                    )
                is_open = is_open or folded
                valid[index, branch + elbow] = bends and _fit(one, low, high, near)
            # A joint left open counts as known once a pose that tells it has been met.
            singular[index, branch >> 1] = is_open and not told
    return positions, valid
