"""What one labelled recording tells of a marker set: a `MarkerModel`."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from besman.stages.label.model import (
    EDGE_S,
    VELOCITY_DECAY_S,
    MarkerModel,
    signed_volumes,
    weigh_neighbours,
)

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LAGS_S = (0.02, 0.04, 0.08, 0.16, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0)
_MAX_FRAMES = 1500
_MOVED_ENOUGH = 0.1  # typical spread of a distance, as a share of it, from which it is believed
_STILL_RIGID = 0.04  # what is added to spreads learnt at rest, as a share of the distance
_STILL_LIMB = 0.12
_STILL_CHANGE = 2.0


def learn_marker_model(
    positions: FloatArray,
    rate_hz: float,
    markers: tuple[str, ...],
    *,
    bodies: tuple[tuple[str, ...], ...] | None = None,
    tolerance: float = 0.03,
    rigid_tolerance_m: float = 0.0008,
    limb_tolerance_m: float = 0.004,
) -> MarkerModel:
    """Learn a marker model from one labelled recording.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Named markers, NaN where not seen, metres.
    rate_hz : float
        Frames per second.
    markers : tuple of str, length M
        Their names.
    bodies : tuple of tuple of str, optional
        Markers that are stuck to one rigid body, whoever wears it. Without it, whatever kept its
        distance in this recording is taken for rigid.
    tolerance : float
        By how much a distance that is not rigid may differ between persons and placements, as a
        share of the distance.
    rigid_tolerance_m, limb_tolerance_m : float
        Least spread of the distance of rigid and of other pairs, metres.

    Returns
    -------
    MarkerModel
        Pairs never seen together get the widest spread there is.
    """
    n_frames = len(positions)
    step = max(1, -(-n_frames // _MAX_FRAMES))
    sampled = positions[::step]
    apart = _measure_distances(sampled)
    with np.errstate(invalid="ignore"):
        distance = _mean_seen(apart)
        own_spread = np.sqrt(_mean_seen((apart - distance) ** 2))
    unknown = ~np.isfinite(distance)
    distance[unknown], own_spread[unknown] = 1.0, 1.0
    rigid: npt.NDArray[np.bool_] = own_spread < np.maximum(0.0015, 0.005 * distance)
    if bodies is not None:
        rigid = np.asarray(rigid & _share_body(markers, bodies))
    # Who stands still shows no joint: then near markers, not steady distances, are tied together.
    moved = float(np.median(own_spread) / np.median(distance))
    stillness = max(0.0, 1.0 - moved / _MOVED_ENOUGH)
    extra = np.where(rigid, rigid_tolerance_m, limb_tolerance_m + tolerance * distance)
    extra += stillness * distance * np.where(rigid, _STILL_RIGID, _STILL_LIMB)
    spread = np.hypot(own_spread, extra)
    change, jump = _learn_changes(positions, rate_hz)
    change, jump = (1.0 + _STILL_CHANGE * stillness) * change, (1.0 + stillness) * jump
    quads, volume, volume_spread = learn_quads(sampled, distance, spread)
    swaps, excess, excess_spread = learn_swaps(apart, distance, spread)
    return MarkerModel(
        markers,
        distance,
        spread,
        np.array(LAGS_S),
        change,
        jump,
        _measure_speed(positions, rate_hz),
        weigh_neighbours(spread),
        quads,
        volume,
        volume_spread,
        swaps,
        excess,
        excess_spread,
        find_alike(distance, spread),
    )


def _share_body(
    markers: tuple[str, ...], bodies: tuple[tuple[str, ...], ...]
) -> npt.NDArray[np.bool_]:
    """Say which markers are on one body, shape (M, M)."""
    member = np.array([[marker in body for body in bodies] for marker in markers], dtype=np.bool_)
    return np.asarray((member[:, None] & member[None]).any(axis=2))


def _measure_distances(positions: FloatArray) -> FloatArray:
    """Return all distances, shape (T, M, M), metres."""
    distances: FloatArray = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1)
    return distances


def _mean_seen(values: FloatArray) -> FloatArray:
    """Return the mean over the first axis of what is not NaN; NaN where there is nothing."""
    seen = np.isfinite(values)
    means: FloatArray = np.where(seen, values, 0.0).sum(axis=0) / np.where(
        seen.any(0), seen.sum(0), np.nan
    )
    return means


def _measure_speed(positions: FloatArray, rate_hz: float) -> FloatArray:
    """Return the root mean square speed of each marker, shape (M,), metres per second."""
    n_edge = max(1, round(EDGE_S * rate_hz))
    velocity = (positions[n_edge:] - positions[:-n_edge]) * (rate_hz / n_edge)
    speed: FloatArray = np.sqrt(_mean_seen(np.sum(velocity**2, axis=2)))
    return np.where(np.isfinite(speed), speed, 0.0) + 0.01


def _learn_changes(positions: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Measure how much distances and positions change over a lag: (L, M, M) and (L, M)."""
    n_frames, n_markers = positions.shape[:2]
    change = np.full((len(LAGS_S), n_markers, n_markers), np.nan)
    jump = np.full((len(LAGS_S), n_markers), np.nan)
    n_edge = max(1, round(EDGE_S * rate_hz))
    for k, lag_s in enumerate(LAGS_S):
        lag = max(1, round(lag_s * rate_hz))
        if lag + 2 * n_edge >= n_frames:
            continue
        begin = np.arange(n_edge, n_frames - lag - n_edge, max(1, n_frames // _MAX_FRAMES))
        before, after = positions[begin], positions[begin + lag]
        squares = (_measure_distances(after) - _measure_distances(before)) ** 2
        change[k] = np.sqrt(_mean_seen(squares))
        incoming = (before - positions[begin - n_edge]) / n_edge
        outgoing = (positions[begin + lag + n_edge] - after) / n_edge
        decay = np.exp(-lag / rate_hz / VELOCITY_DECAY_S)
        error = after - before - 0.5 * lag * decay * (incoming + outgoing)
        jump[k] = np.sqrt(_mean_seen((error**2).mean(axis=2)))
    for table, least in ((change, 0.0005), (jump, 0.001)):
        flat = np.where(np.isfinite(table), table, 0.0).reshape(len(table), -1)
        typical = np.median(flat, axis=1)
        for k in range(len(table)):
            filler = table[k - 1] if k else np.full_like(table[0], 0.01)
            table[k] = np.where(np.isfinite(table[k]), table[k], filler)
            # A marker at rest while the model was learnt may move in the next recording.
            table[k] = np.maximum(table[k], 0.3 * typical[k]) + least
            table[k] = np.maximum(table[k], filler if k else 0.0)
    return change, jump


def learn_quads(
    positions: FloatArray,
    distance: FloatArray,
    spread: FloatArray,
    n_near: int = 7,
    n_kept: int = 4,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Find the most reliable signed volumes of each marker with its most rigid neighbours."""
    n_markers = positions.shape[1]
    found: dict[tuple[int, ...], tuple[float, float]] = {}
    positions = positions[:: max(1, len(positions) // 200)]
    masked = spread + np.where(np.eye(n_markers, dtype=bool), np.inf, 0.0)
    for a in range(n_markers):
        near = np.argsort(masked[a], kind="stable")[: min(n_near, n_markers - 1)]
        triples = np.array(list(combinations(near, 3)), dtype=np.int64).reshape(-1, 3)
        volume = signed_volumes(positions, np.insert(triples, 0, a, axis=1))
        mean = _mean_seen(volume)
        own = np.sqrt(_mean_seen((volume - mean) ** 2))
        size = np.prod(distance[a][triples], axis=1)
        floor = 0.05 * size
        deviation = np.hypot(own, floor)
        quality = np.nan_to_num(np.abs(mean) / deviation)
        for k in np.argsort(-quality, kind="stable")[:n_kept]:
            if quality[k] > 1.5:
                found[(a, *triples[k])] = (mean[k], deviation[k])
    quads = np.array(list(found), dtype=np.int64).reshape(-1, 4)
    values = np.array(list(found.values())).reshape(-1, 2)
    return quads, values[:, 0], values[:, 1]


def learn_swaps(
    apart: FloatArray, distance: FloatArray, spread: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Find for near pairs a, b the third marker whose distances tell them apart best."""
    n_markers = apart.shape[1]
    swaps, excess, excess_spread = [], [], []
    masked = distance + np.where(np.eye(n_markers, dtype=bool), np.inf, 0.0)
    for a in range(n_markers):
        for b in np.argsort(masked[a], kind="stable")[:3]:
            if b < a and a in np.argsort(masked[b], kind="stable")[:3]:
                continue
            difference = apart[:, a] - apart[:, b]
            mean = _mean_seen(difference)
            own = np.sqrt(_mean_seen((difference - mean) ** 2))
            deviation = np.hypot(own, 0.05 * distance[a, b] + 0.001)
            quality = np.nan_to_num(np.abs(mean) / deviation)
            quality[[a, b]] = 0.0
            for c in np.argsort(-quality, kind="stable")[:2]:
                if quality[c] > 1.0:
                    swaps.append((a, b, c))
                    excess.append(mean[c])
                    excess_spread.append(deviation[c])
    return np.array(swaps, dtype=np.int64).reshape(-1, 3), np.array(excess), np.array(excess_spread)


def find_alike(
    distance: FloatArray, spread: FloatArray, n_near: int = 3, enough: float = 12.0
) -> IntArray:
    """Find near pairs of markers whose exchange the distances to all others would not betray."""
    n_markers = len(distance)
    weight = weigh_neighbours(spread)
    masked = distance + np.where(np.eye(n_markers, dtype=bool), np.inf, 0.0)
    near = np.argsort(masked, axis=1, kind="stable")[:, :n_near]
    pairs = {(min(a, b), max(a, b)) for a in range(n_markers) for b in near[a].tolist() if a != b}
    alike = []
    for a, b in sorted(pairs):
        others = np.ones(n_markers, dtype=bool)
        others[[a, b]] = False
        betrayal = 0.0
        for one, two in ((a, b), (b, a)):
            squared = ((distance[one] - distance[two]) / spread[two])[others] ** 2
            betrayal += float(weight[two][others] @ (2.5 * np.log1p(squared / 4.0)))
        if betrayal < enough:
            alike.append((a, b))
    return np.array(alike, dtype=np.int64).reshape(-1, 2)
