"""Distances of an arm to itself, to its pedestal and to the floor, by capsules."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.robot.body_balls import Bodies, add_movement, group_pairs, place_balls
from besman.robot.kinematics import as_rows, compiled, fill_frames
from besman.robot.parts import Chain

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# More than rounding makes of what bodies have moved, metres.
_ROUNDING_M = 1e-9
# Cosine of the angle between an axis and the vertical, about two degrees.
_UPRIGHT = 0.9994


def distances(chain: Chain, positions: npt.ArrayLike, beyond: float = np.inf) -> FloatArray:
    """Compute how near an arm is to itself and to the floor.

    The first is the least distance between parts that must not touch, below zero where capsules
    overlap, the second the least height of the moving parts.

    Parameters
    ----------
    chain : Chain
        The arm with its capsules. A first joint that stands upright only turns its link above the
        base: that link is not measured against the floor.
    positions : array, shape (..., n)
        Joint angles, rad.
    beyond : float
        A self-distance greater than this is this, metres: to look for less is quicker.

    Returns
    -------
    array, shape (..., 2)
        Self-distance and floor distance, metres; infinite where there are no capsules, NaN where
        the angles are not finite.
    """
    rows, shape = as_rows(chain, positions)
    result = _distances(
        chain.placements,
        chain.axes,
        chain.capsule_joints,
        chain.capsule_ends,
        chain.capsule_radii,
        chain.capsule_pairs,
        rows,
        beyond,
    )
    result[~np.isfinite(rows).all(axis=1)] = np.nan
    return result.reshape(*shape, 2)


def distances_between(
    first: Chain, first_positions: npt.ArrayLike, second: Chain, second_positions: npt.ArrayLike
) -> FloatArray:
    """Compute the distance between the moving parts of two arms with one world.

    Parameters
    ----------
    first, second : Chain
    first_positions, second_positions : array, shape (..., n)
        Joint angles of each arm at the same moments, rad.

    Returns
    -------
    array, shape (...)
        Metres; below zero where capsules overlap, infinite where an arm has none.
    """
    rows, shape = as_rows(first, first_positions)
    others, other_shape = as_rows(second, second_positions)
    if shape != other_shape:
        raise RobotError(
            f"distances_between: got positions of {shape} and {other_shape} moments, expected the "
            "same for both arms"
        )
    arms = [
        (chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends, angles)
        for chain, angles in ((first, rows), (second, others))
    ]
    placed = [place_all(*arm) for arm in arms]
    moving = [chain.capsule_joints >= 0 for chain in (first, second)]
    result = least_gaps(
        placed[0][:, moving[0]],
        first.capsule_radii[moving[0]],
        placed[1][:, moving[1]],
        second.capsule_radii[moving[1]],
        np.inf,
    )
    return result.reshape(shape)


@compiled
def place_all(
    placements: FloatArray, axes: FloatArray, joints: IntArray, ends: FloatArray, rows: FloatArray
) -> FloatArray:
    """Return the capsules' ends in the world for every configuration, shape (B, C, 2, 3)."""
    rotations, origins = np.empty((len(axes), 3, 3)), np.empty((len(axes), 3))
    placed = np.empty((len(rows), len(joints), 2, 3))
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed[index])
    return placed


@compiled
def least_gaps(
    first: FloatArray,
    first_radii: FloatArray,
    second: FloatArray,
    second_radii: FloatArray,
    beyond: float,
) -> FloatArray:
    """Return the least distance of two sets of placed capsules (B, C, 2, 3) in every pose (B,).

    What is further apart than `beyond`, metres, is that: to look for less is quicker.
    """
    result = np.full(len(first), beyond)
    one_ball, other_ball = np.empty((len(first_radii), 4)), np.empty((len(second_radii), 4))
    for index in range(len(first)):
        _fill_balls(first[index], first_radii, one_ball)
        _fill_balls(second[index], second_radii, other_ball)
        for one in range(len(first_radii)):
            for other in range(len(second_radii)):
                reach = result[index] + one_ball[one, 3] + other_ball[other, 3]
                if are_far(one_ball[one], other_ball[other], reach):
                    continue
                distance = segment_distance(
                    first[index, one, 0],
                    first[index, one, 1],
                    second[index, other, 0],
                    second[index, other, 1],
                )
                gap = distance - first_radii[one] - second_radii[other]
                result[index] = min(result[index], gap)
    return result


@compiled
def _fill_balls(placed: FloatArray, radii: FloatArray, balls: FloatArray) -> None:
    """Write middles and radii (C, 4) of the balls that enclose placed capsules, metres."""
    for capsule in range(len(radii)):
        square = 0.0
        for row in range(3):
            low, high = placed[capsule, 0, row], placed[capsule, 1, row]
            balls[capsule, row] = 0.5 * (low + high)
            square += (high - low) ** 2
        balls[capsule, 3] = 0.5 * np.sqrt(square) + radii[capsule]


@compiled
def place_capsules(
    joints: IntArray,
    ends: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    placed: FloatArray,
) -> None:
    """Write the capsules' ends in the world into `placed`, shape (C, 2, 3)."""
    for capsule in range(len(joints)):
        joint = joints[capsule]
        for end in range(2):
            for row in range(3):
                if joint < 0:
                    placed[capsule, end, row] = ends[capsule, end, row]
                else:
                    placed[capsule, end, row] = (
                        origins[joint, row]
                        + rotations[joint, row, 0] * ends[capsule, end, 0]
                        + rotations[joint, row, 1] * ends[capsule, end, 1]
                        + rotations[joint, row, 2] * ends[capsule, end, 2]
                    )


@compiled
def segment_shares(
    p0: FloatArray, p1: FloatArray, q0: FloatArray, q1: FloatArray
) -> tuple[float, float]:
    """Return where two segments in space, which may be points, are nearest: shares of their ways.

    References
    ----------
    C. Ericson: Real-Time Collision Detection, 2005, section 5.1.9.
    """
    u0, u1, u2 = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    v0, v1, v2 = q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]
    w0, w1, w2 = p0[0] - q0[0], p0[1] - q0[1], p0[2] - q0[2]
    a, e = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    b = u0 * v0 + u1 * v1 + u2 * v2
    c, f = u0 * w0 + u1 * w1 + u2 * w2, v0 * w0 + v1 * w1 + v2 * w2
    tiny = 1e-14
    s, t = 0.0, 0.0
    if a > tiny and e > tiny:
        below = a * e - b * b
        if below > 1e-12 * a * e:
            s = min(max((b * f - c * e) / below, 0.0), 1.0)
        t = (b * s + f) / e
        if t < 0.0:
            t, s = 0.0, min(max(-c / a, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((b - c) / a, 0.0), 1.0)
    elif a > tiny:
        s = min(max(-c / a, 0.0), 1.0)
    elif e > tiny:
        t = min(max(f / e, 0.0), 1.0)
    return s, t


@compiled
def segment_distance(p0: FloatArray, p1: FloatArray, q0: FloatArray, q1: FloatArray) -> float:
    """Compute the distance between two segments in space, which may be points."""
    s, t = segment_shares(p0, p1, q0, q1)
    square = 0.0
    for row in range(3):
        way = p0[row] + s * (p1[row] - p0[row]) - q0[row] - t * (q1[row] - q0[row])
        square += way * way
    return float(np.sqrt(square))


@compiled
def are_far(first: FloatArray, second: FloatArray, reach: float) -> bool:
    """Tell whether two points are further apart than this, metres."""
    if reach <= 0.0:
        return True
    x, y, z = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    return bool(x * x + y * y + z * z > reach * reach)


@compiled
def ball_gap(first: FloatArray, second: FloatArray, reach: float, other: float) -> float:
    """Return how far apart two balls are, of their middles and radii, metres."""
    x, y, z = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    return float(np.sqrt(x * x + y * y + z * z) - reach - other)


@compiled
def first_falling(placements: FloatArray, axes: FloatArray) -> int:
    """Return the first joint that can bring its link nearer to the floor: 0 if its axis lies.

    Parameters
    ----------
    placements, axes : array
        As in `besman.robot.parts.Chain`.
    """
    if len(axes) == 0:
        return 0
    upwards = 0.0
    for row in range(3):
        upwards += placements[0, 2, row] * axes[0, row]
    return 1 if abs(upwards) > _UPRIGHT else 0


@compiled
def nearest_parts(
    joints: IntArray,
    placed: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    bodies: Bodies,
    guess: int,
    beyond: float,
    falling: int,
) -> tuple[float, float, int, int]:
    """Compute self-distance and floor distance, metres, and which pair and capsule have them.

    Both are -1 where there is none. What is further apart than the nearest so far is passed over:
    first whole bodies, by balls around them, then pairs of capsules, of many by what they were
    apart in poses before; what is further apart than `beyond` (metres) at once: the self-distance
    is then `beyond`. Only capsules of the joint `falling` and later ones are measured against the
    floor. The pair `guess` comes first (-1: none), by choice that of the pose before. `bodies` are
    those of `group_pairs`.
    """
    nearest, pair, lowest, down = beyond, -1, np.inf, -1
    middles, reaches, runs = bodies.middles, bodies.reaches, bodies.runs
    place_balls(placed, bodies)
    own, count = len(joints), -1
    if len(bodies.memory) > 0:
        nearest, pair = _nearest_of_many(
            placed,
            radii,
            pairs,
            bodies.owners,
            runs,
            reaches,
            middles,
            bodies.memory,
            guess,
            beyond,
        )
        count = len(runs)
    while count < len(runs):
        first, last, is_run = guess, guess + 1, count >= 0
        if is_run:
            one, other, first, last = runs[count, 0], runs[count, 1], runs[count, 2], runs[count, 3]
            far = nearest + reaches[own + one] + reaches[own + other]
            if are_far(middles[own + one], middles[own + other], far):
                last = first
        elif guess < 0:
            last = first
        count += 1
        for index in range(first, last):
            a, b = pairs[index, 0], pairs[index, 1]
            far = nearest + reaches[a] + reaches[b]
            if are_far(middles[a], middles[b], far) or (is_run and index == guess):
                continue
            gap = segment_distance(placed[a, 0], placed[a, 1], placed[b, 0], placed[b, 1])
            gap -= radii[a] + radii[b]
            if gap < nearest:
                nearest, pair = gap, index
    for capsule in range(len(joints)):
        if joints[capsule] >= falling:
            low = min(placed[capsule, 0, 2], placed[capsule, 1, 2])
            if low - radii[capsule] < lowest:
                lowest, down = low - radii[capsule], capsule
    return nearest, lowest, pair, down


@compiled
def _nearest_of_many(
    placed: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    owners: IntArray,
    runs: IntArray,
    reaches: FloatArray,
    middles: FloatArray,
    memory: FloatArray,
    guess: int,
    beyond: float,
) -> tuple[float, int]:
    """Compute the least gap of pairs, and which pair has it, the guess first.

    What was so far apart in a pose before that its bodies cannot have come as near as the nearest
    since is passed over. Arrays as in `besman.robot.body_balls.Bodies`.

    References
    ----------
    B. Mirtich: Impulse-based dynamic simulation of rigid body systems, PhD thesis, 1996, section
    2.3: bounds of distances hold for as long as bodies have not moved as far.
    """
    nearest, pair, own = beyond, -1, len(placed)
    n_bodies = len(reaches) - own
    moved = add_movement(placed, owners, n_bodies, memory)
    run_bounds = memory[len(memory) - len(runs) - len(pairs) : len(memory) - len(pairs)]
    bounds = memory[len(memory) - len(pairs) :]
    if guess >= 0:
        a, b = pairs[guess, 0], pairs[guess, 1]
        gap = segment_distance(placed[a, 0], placed[a, 1], placed[b, 0], placed[b, 1])
        gap -= radii[a] + radii[b]
        if gap < nearest:
            nearest, pair = gap, guess
    for count in range(len(runs)):
        one, other = runs[count, 0], runs[count, 1]
        way = moved[one] + moved[other] + _ROUNDING_M
        far = nearest + reaches[own + one] + reaches[own + other]
        if run_bounds[count] - way > nearest or are_far(
            middles[own + one], middles[own + other], far
        ):
            continue
        least = np.inf
        for index in range(runs[count, 2], runs[count, 3]):
            if bounds[index] - way <= nearest and index != guess:
                a, b = pairs[index, 0], pairs[index, 1]
                gap = ball_gap(middles[a], middles[b], reaches[a], reaches[b])
                if gap <= nearest:
                    gap = segment_distance(placed[a, 0], placed[a, 1], placed[b, 0], placed[b, 1])
                    gap -= radii[a] + radii[b]
                    if gap < nearest:
                        nearest, pair = gap, index
                bounds[index] = gap + way
            least = min(least, bounds[index])
        run_bounds[count] = least
    return nearest, pair


@compiled
def add_motion(
    axes: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    joint: int,
    point: FloatArray,
    along: FloatArray,
    slope: FloatArray,
) -> None:
    """Add to `slope` (n,) how far a point moves along a direction, per rad of every joint.

    Parameters
    ----------
    axes, rotations, origins : array
        As `besman.robot.kinematics.fill_frames` has and writes them.
    joint : int
        That moves the point; -1: none.
    point, along : array, shape (3,)
        In the world, metres.
    slope : array, shape (n,)
        Written to, metres per rad.
    """
    for j in range(joint + 1):
        turn = rotations[j]
        a = turn[0, 0] * axes[j, 0] + turn[0, 1] * axes[j, 1] + turn[0, 2] * axes[j, 2]
        b = turn[1, 0] * axes[j, 0] + turn[1, 1] * axes[j, 1] + turn[1, 2] * axes[j, 2]
        d = turn[2, 0] * axes[j, 0] + turn[2, 1] * axes[j, 1] + turn[2, 2] * axes[j, 2]
        x, y, z = point[0] - origins[j, 0], point[1] - origins[j, 1], point[2] - origins[j, 2]
        slope[j] += (
            along[0] * (b * z - d * y) + along[1] * (d * x - a * z) + along[2] * (a * y - b * x)
        )


@compiled
def _distances(
    placements: FloatArray,
    axes: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    rows: FloatArray,
    beyond: float,
) -> FloatArray:
    """Compute both distances of every configuration, shape (B, 2)."""
    n = len(axes)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    placed = np.empty((len(joints), 2, 3))
    result, nearest = np.empty((len(rows), 2)), -1
    falling, bodies = first_falling(placements, axes), group_pairs(joints, ends, radii, pairs)
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed)
        own, floor, nearest, _ = nearest_parts(
            joints, placed, radii, pairs, bodies, nearest, beyond, falling
        )
        result[index, 0], result[index, 1] = own, floor
    return result
