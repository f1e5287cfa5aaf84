"""The nearest two of many capsules: what is far, or was far and has not moved, is passed over."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.body_balls import Bodies, add_movement, place_balls
from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# More than rounding makes of what bodies have moved, metres.
_ROUNDING_M = 1e-9


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
