"""Balls around capsules and around the bodies they belong to: what is far is told at a glance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Of fewer pairs it costs more to remember how far apart they were than to look again.
_REMEMBERED_FROM = 150


class Bodies(NamedTuple):
    """Pairs of capsules by the bodies they belong to: all capsules that one joint moves.

    Attributes
    ----------
    owners : int array, shape (C,)
        Body of each capsule: 0 what stands still, 1 what the first joint moves, and so on.
    counts : int array, shape (B,)
        How many capsules each body has.
    runs : int array, shape (R, 4)
        Two bodies, and the first and one past the last of their pairs of capsules.
    reaches : array, shape (C + B,)
        Radii of the balls that enclose each capsule, then each body, metres.
    middles : array, shape (C + B, 3)
        Their middles in the world, metres; `place_balls` writes them.
    memory : array, shape (6 C + 2 B + R + P,)
        Of many pairs, else empty, one after the other: ends of the capsules in the pose before;
        how far each body has moved at most since the first pose, and the square of its last step;
        of every run, then of every pair, what it was apart at least and, added, how far its two
        bodies had moved by then: they have come nearer by no more than they have moved since.
        Metres.
    """

    owners: IntArray
    counts: IntArray
    runs: IntArray
    reaches: FloatArray
    middles: FloatArray
    memory: FloatArray


@compiled
def group_pairs(joints: IntArray, ends: FloatArray, radii: FloatArray, pairs: IntArray) -> Bodies:
    """Return the bodies of capsules, and the runs of pairs that are of the same two.

    Parameters
    ----------
    joints, ends, radii, pairs : array
        As ``capsule_joints``, ... of a `besman.robot.parts.Chain`; pairs of the same bodies should
        be neighbours.
    """
    n_capsules, n_bodies = len(joints), 1
    for capsule in range(n_capsules):
        n_bodies = max(n_bodies, joints[capsule] + 2)
    owners, counts = np.empty(n_capsules, np.int64), np.zeros(n_bodies, np.int64)
    for capsule in range(n_capsules):
        owners[capsule] = joints[capsule] + 1
        counts[owners[capsule]] += 1
    n_runs = 0
    runs = np.empty((len(pairs), 4), np.int64)
    for index in range(len(pairs)):
        one, other = owners[pairs[index, 0]], owners[pairs[index, 1]]
        if n_runs == 0 or runs[n_runs - 1, 0] != one or runs[n_runs - 1, 1] != other:
            runs[n_runs, 0], runs[n_runs, 1], runs[n_runs, 2] = one, other, index
            n_runs += 1
        runs[n_runs - 1, 3] = index + 1
    reaches, middles = np.zeros(n_capsules + n_bodies), np.empty((n_capsules + n_bodies, 3))
    memory = np.empty(0)
    if len(pairs) >= _REMEMBERED_FROM:
        memory = np.zeros(6 * n_capsules + 2 * n_bodies + n_runs + len(pairs))
        memory[6 * n_capsules + 2 * n_bodies :] = -np.inf
    bodies = Bodies(owners, counts, runs[:n_runs].copy(), reaches, middles, memory)
    # Within its body nothing moves: as well in the frames of the joints as in the world.
    place_balls(ends, bodies)
    for capsule in range(n_capsules):
        body, length, away = n_capsules + owners[capsule], 0.0, 0.0
        for row in range(3):
            length += (ends[capsule, 1, row] - ends[capsule, 0, row]) ** 2
            away += (middles[capsule, row] - middles[body, row]) ** 2
        reaches[capsule] = 0.5 * np.sqrt(length) + radii[capsule]
        reaches[body] = max(reaches[body], np.sqrt(away) + reaches[capsule])
    return bodies


@compiled
def place_balls(placed: FloatArray, bodies: Bodies) -> None:
    """Write the balls' middles: of capsules whose ends (C, 2, 3) are placed, and of bodies.

    A body's ball is around the mean of its capsules' middles.
    """
    own, middles = len(placed), bodies.middles
    for body in range(len(bodies.counts)):
        for row in range(3):
            middles[own + body, row] = 0.0
    for capsule in range(own):
        body = own + bodies.owners[capsule]
        for row in range(3):
            middle = 0.5 * (placed[capsule, 0, row] + placed[capsule, 1, row])
            middles[capsule, row] = middle
            middles[body, row] += middle
    for body in range(len(bodies.counts)):
        if bodies.counts[body] > 0:
            for row in range(3):
                middles[own + body, row] /= bodies.counts[body]


@compiled
def add_movement(
    placed: FloatArray, owners: IntArray, n_bodies: int, memory: FloatArray
) -> FloatArray:
    """Add how far bodies have moved since the pose before: as far as ends of capsules at most.

    Parameters
    ----------
    placed : array, shape (C, 2, 3)
        Ends in the world, metres.
    owners, n_bodies, memory
        As in `Bodies`; the memory is written.

    Returns
    -------
    array, shape (B,)
        How far each has moved since the first pose, metres: a part of the memory.
    """
    ends = 6 * len(placed)
    moved, steps = memory[ends : ends + n_bodies], memory[ends + n_bodies : ends + 2 * n_bodies]
    here = 0
    for capsule in range(len(placed)):
        body = owners[capsule]
        for end in range(2):
            square = 0.0
            for row in range(3):
                square += (placed[capsule, end, row] - memory[here]) ** 2
                memory[here] = placed[capsule, end, row]
                here += 1
            steps[body] = max(steps[body], square)
    for body in range(n_bodies):
        moved[body] += np.sqrt(steps[body])
        steps[body] = 0.0
    return moved
