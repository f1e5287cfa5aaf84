"""The sequence of branches over a whole path: dynamic programming over configurations a pose."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_TURN = 2.0 * np.pi
# A step at the speed limit costs as much as this pose error, in metres.
_STEP_COST_M = 1e-3
# Above this multiple of the speed limit a step is a jump: it costs what the poses would that are
# missed meanwhile, in square metres a unit.
_JUMP = 3.0
_JUMP_COST_M2 = 0.01


def choose_sequences(
    states: FloatArray,
    costs: FloatArray,
    reach: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    n_sequences: int,
) -> FloatArray:
    """Choose, from the configurations at hand for every pose, sequences of least total cost.

    Joints with a full turn between their limits are compared around the circle and unwound
    afterwards; where the unwound path does not fit between the limits their full turns become
    configurations of their own.

    Parameters
    ----------
    states : array, shape (T, S, n)
        Configurations of every pose, rad.
    costs : array, shape (T, S)
        What each costs, square metres; infinite for those that are none.
    reach : array, shape (n,)
        How far each joint goes between two poses at its speed limit, rad.
    low, high, home : array, shape (n,)
        Limits, and where a full turn more or less is open the preferred angles, rad.
    n_sequences : int
        Greatest number; each ends in another configuration.

    Returns
    -------
    array, shape (K, T, n)
        rad, in the order of their cost; empty where a pose has no configuration at all.

    References
    ----------
    A. J. Viterbi: Error bounds for convolutional codes and an asymptotically optimum decoding
    algorithm, 1967. doi:10.1109/TIT.1967.1054010
    """
    circular = high - low >= _TURN
    while True:
        spread, all_costs = _spread_turns(states, costs, ~circular, low, high)
        order, sequences = _viterbi(spread, all_costs, 1.0 / reach, circular)
        kept = []
        for end in order[:n_sequences]:
            path = np.take_along_axis(spread, sequences[end][:, None, None], axis=1)[:, 0]
            unwound, fits = _unwind(path, circular, low, high, home)
            if not np.all(fits):
                circular = circular & fits
                break
            kept.append(unwound)
        else:
            return np.array(kept).reshape(-1, *states.shape[::2])


def _spread_turns(
    states: FloatArray, costs: FloatArray, chosen: BoolArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Add the full turns more and less of the chosen joints as configurations of their own."""
    for joint in np.flatnonzero(chosen & (high - low >= _TURN)):
        shifted, prices = [states], [costs]
        for turns in (-_TURN, _TURN):
            copy = states.copy()
            copy[..., joint] += turns
            inside = (copy[..., joint] >= low[joint]) & (copy[..., joint] <= high[joint])
            shifted.append(copy)
            prices.append(np.where(inside, costs, np.inf))
        states, costs = np.concatenate(shifted, axis=1), np.concatenate(prices, axis=1)
        used = np.isfinite(costs).any(axis=0)
        states, costs = states[:, used], costs[:, used]
    return states, costs


def _unwind(
    path: FloatArray, circular: BoolArray, low: FloatArray, high: FloatArray, home: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Make a path continuous and shift each joint by full turns into its limits, near home."""
    angles = path[:, circular]
    # Continuous from the first pose on.
    angles[1:] -= _TURN * np.cumsum(np.rint(np.diff(angles, axis=0) / _TURN), axis=0)
    first = np.ceil((low[circular] - angles.min(axis=0)) / _TURN)
    last = np.floor((high[circular] - angles.max(axis=0)) / _TURN)
    wanted = np.rint((home[circular] - angles.mean(axis=0)) / _TURN)
    unwound, fits = path.copy(), np.ones(len(low), dtype=bool)
    fits[circular] = first <= last
    unwound[:, circular] = angles + _TURN * np.clip(wanted, first, np.maximum(first, last))
    return unwound, fits


def _viterbi(
    states: FloatArray, costs: FloatArray, scale: FloatArray, circular: BoolArray
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the ends in the order of their cost, without those of no sequence, and sequences.

    The sequences have shape (S, T): indices of the configurations, by their end.
    """
    totals, back = _sweep(
        np.array(states, order="C"), np.array(costs, order="C"), np.array(scale), np.array(circular)
    )
    n_poses, n_states = back.shape
    sequences = np.empty((n_states, n_poses), dtype=np.int64)
    sequences[:, -1] = np.arange(n_states)
    for index in range(n_poses - 1, 0, -1):
        sequences[:, index - 1] = back[index, sequences[:, index]]
    order = np.argsort(totals, kind="stable")
    return order[np.isfinite(totals[order])], sequences


@compiled
def _sweep(
    states: FloatArray, costs: FloatArray, scale: FloatArray, circular: BoolArray
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Compute the least cost up to each last configuration, and each one's predecessor."""
    n_poses, n_states, n = states.shape
    total, before = costs[0].copy(), np.empty(n_states)
    back = np.zeros((n_poses, n_states), np.int64)
    for index in range(1, n_poses):
        for state in range(n_states):
            before[state] = total[state]
        for state in range(n_states):
            least, source = np.inf, 0
            if np.isfinite(costs[index, state]):
                for other in range(n_states):
                    if before[other] >= least:
                        continue
                    square = greatest = 0.0
                    for j in range(n):
                        way = states[index, state, j] - states[index - 1, other, j]
                        if circular[j]:
                            way -= _TURN * np.rint(way / _TURN)
                        way = abs(way) * scale[j]
                        square += way * way
                        greatest = max(greatest, way)
                    price = before[other] + _STEP_COST_M**2 * square
                    price += _JUMP_COST_M2 * max(0.0, greatest - _JUMP)
                    if price < least:
                        least, source = price, other
            total[state] = least + costs[index, state]
            back[index, state] = source
    return total, back
