"""A marker model from a marker set's own pose and distances, without any recording."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError
from besman.person.marker_set import MarkerSet
from besman.stages.label.learning import LAGS_S, find_alike, learn_quads, learn_swaps
from besman.stages.label.model import MarkerModel, weigh_neighbours

FloatArray = npt.NDArray[np.float64]

# How a person moves, where nothing was learnt: medians over reaching and throwing, by lag.
_CHANGE_RIGID_M = (0.002, 0.003, 0.005, 0.010, 0.015, 0.021, 0.026, 0.027, 0.030, 0.032)
_CHANGE_LIMB_M = (0.006, 0.010, 0.022, 0.042, 0.071, 0.100, 0.121, 0.130, 0.135, 0.143)
_JUMP_M = (0.002, 0.004, 0.012, 0.035, 0.080, 0.140, 0.200, 0.260, 0.300, 0.300)
_SPEED_M_S = 0.6
_RIGID_SPREAD_M = 0.003
_RIGID_SPREAD = 0.03  # share of the distance: clusters are stuck on anew for each recording
_LIMB_SPREAD_M = 0.005
_LIMB_SPREAD = 0.05
_FREE_SPREAD_M = 0.02
_FREE_SPREAD = 0.25  # share of the distance: joints move


def model_from_pose(marker_set: MarkerSet) -> MarkerModel:
    """Make a model from the initial pose and the distances that a marker set gives.

    Parameters
    ----------
    marker_set : MarkerSet
        `pose_m` of the markers that can be found; distances in a cluster are steady, those in
        `distances_m` nearly so, all others change with the pose.

    Returns
    -------
    MarkerModel
        Of the markers with a pose.

    Raises
    ------
    LabellingError
        If a required marker has no pose.
    """
    missing = [marker for marker in marker_set.required if marker not in marker_set.pose_m]
    if missing or not marker_set.pose_m:
        raise LabellingError(
            f"marker set {marker_set.name}: pose_m does not say where marker "
            f"{(missing or ['of any name'])[0]!r} is; give its place, or a recording with names "
            "to learn from (learn_from)"
        )
    markers = tuple(marker for marker in marker_set.markers if marker in marker_set.pose_m)
    pose = np.array([marker_set.pose_m[marker] for marker in markers])
    distance = np.linalg.norm(pose[:, None] - pose, axis=2)
    rigid = np.zeros(distance.shape, dtype=np.bool_)
    steady = rigid.copy()
    for cluster in marker_set.clusters.values():
        member = [markers.index(marker) for marker in cluster if marker in markers]
        rigid[np.ix_(member, member)] = True
    for a, others in marker_set.distances_m.items():
        for b, apart in others.items():
            if a in markers and b in markers:
                i, j = markers.index(a), markers.index(b)
                distance[[i, j], [j, i]] = apart
                steady[[i, j], [j, i]] = True
    spread = np.where(
        rigid,
        _RIGID_SPREAD_M + _RIGID_SPREAD * distance,
        np.where(
            steady,
            _LIMB_SPREAD_M + _LIMB_SPREAD * distance,
            _FREE_SPREAD_M + _FREE_SPREAD * distance,
        ),
    )
    near = (rigid | steady)[None]
    change = np.where(
        near,
        np.array(_CHANGE_RIGID_M)[:, None, None],
        np.array(_CHANGE_LIMB_M)[:, None, None],
    )
    quads = learn_quads(pose[None], distance, spread)
    swaps = learn_swaps(distance[None], distance, spread)
    return MarkerModel(
        markers,
        distance,
        spread,
        np.array(LAGS_S),
        change,
        np.repeat(np.array(_JUMP_M)[:, None], len(markers), axis=1),
        np.full(len(markers), _SPEED_M_S),
        weigh_neighbours(spread),
        *quads,
        *swaps,
        find_alike(distance, spread),
    )
