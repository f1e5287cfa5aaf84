"""Features of movement segments, relative to the person."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, RecognitionError, nearest
from besman.geometry.frames import hand_frame
from besman.person.body import Arm, find_body
from besman.records import LabelledRecording
from besman.stages.recognize.stretches import BACK_MARKERS, Stretch, cut_stretch

FloatArray = npt.NDArray[np.float64]

_ARM_PARTS = (
    "hand_top",
    "hand_left",
    "hand_right",
    "shoulder",
    "elbow",
    "thumb",
    "index",
    "middle",
)
BODY_MARKERS = (
    *BACK_MARKERS,
    *(f"{side}{part}" for side in ("", "right_", "left_") for part in _ARM_PARTS),
)
"""Markers on the person; any other marker of a recording is on an object."""

# Where logarithms of speeds and distances become linear: slower is rest, nearer is contact.
_REST_M_S = 0.05
_CONTACT_M = 0.05


Feature = Callable[[Stretch, Sequence[str], Sequence[str]], FloatArray]
"""From stretch, markers and object markers to channels, shape (S, P, C)."""
ArmFeature = Callable[[Stretch, Arm], FloatArray]


def _each_arm(feature: ArmFeature) -> Feature:
    """Make a feature of all arms out of one of a single arm."""

    def together(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
        return np.concatenate([feature(stretch, arm) for arm in stretch.arms], axis=2)

    return together


def _positions(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return np.concatenate([stretch.paths[name] for name in markers], axis=2)


def _displacements(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    positions = _positions(stretch, markers, objects)
    return positions - positions[:, :1]


def _speeds(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return np.concatenate([stretch.speed(stretch.paths[name]) for name in markers], axis=2)


def _hand_orientation(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    if stretch.hand_axes:
        return np.concatenate(stretch.hand_axes, axis=2)
    # Two axes of the rotation matrix: unlike angles and quaternions they never jump.
    axes = []
    for arm in stretch.arms:
        rotation, _ = hand_frame(*(stretch.paths[name] for name in arm.cluster))
        axes += [rotation[..., 0], rotation[..., 2]]
    return np.concatenate(axes, axis=2)


def _elbow_angle(stretch: Stretch, arm: Arm) -> FloatArray:
    elbow = stretch.paths[arm.elbow]
    return _angle(stretch.paths[arm.shoulder] - elbow, stretch.paths[arm.hand] - elbow)


def _shoulder_angle(stretch: Stretch, arm: Arm) -> FloatArray:
    top, left, right = (stretch.paths[name] for name in stretch.back)
    down = (left + right) / 2 - top
    if stretch.back != BACK_MARKERS:
        # Shoulders are level with or above the chest's segment, and one of them may stand for it.
        down = np.broadcast_to([0.0, 0.0, -1.0], down.shape)
    return _angle(down, stretch.paths[arm.elbow] - stretch.paths[arm.shoulder])


def _elbow_rate(stretch: Stretch, arm: Arm) -> FloatArray:
    return stretch.rate(_elbow_angle(stretch, arm))


def _shoulder_rate(stretch: Stretch, arm: Arm) -> FloatArray:
    return stretch.rate(_shoulder_angle(stretch, arm))


def _log_hand_speed(stretch: Stretch, arm: Arm) -> FloatArray:
    return np.log(stretch.speed(stretch.paths[arm.hand]) + _REST_M_S)


def _object_distance(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    centre = stretch.object_path(objects)
    apart = [centre - stretch.paths[arm.hand] for arm in stretch.arms]
    return np.concatenate([np.linalg.norm(one, axis=2, keepdims=True) for one in apart], axis=2)


def _object_speed(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return stretch.speed(stretch.object_path(objects))


def _log_object_distance(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    return np.log(_object_distance(stretch, markers, objects) + _CONTACT_M)


def _log_object_speed(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    return np.log(_object_speed(stretch, markers, objects) + _REST_M_S)


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors, radians, shape (S, P, 1)."""
    sine = np.linalg.norm(np.cross(a, b), axis=2, keepdims=True)
    angle: FloatArray = np.arctan2(sine, np.sum(a * b, axis=2, keepdims=True))
    return angle


# What a feature needs of each arm: nothing, its hand, its three markers, or the hand's cluster.
_FEATURES: dict[str, tuple[Feature, str]] = {
    "positions": (_positions, ""),
    "speeds": (_speeds, ""),
    "hand_orientation": (_hand_orientation, "cluster"),
    "elbow_angle": (_each_arm(_elbow_angle), "arm"),
    "elbow_rate": (_each_arm(_elbow_rate), "arm"),
    "shoulder_angle": (_each_arm(_shoulder_angle), "arm"),
    "shoulder_rate": (_each_arm(_shoulder_rate), "arm"),
    "object_distance": (_object_distance, "hand"),
    "object_speed": (_object_speed, ""),
    "displacements": (_displacements, ""),
    "log_hand_speed": (_each_arm(_log_hand_speed), "hand"),
    "log_object_distance": (_log_object_distance, "hand"),
    "log_object_speed": (_log_object_speed, ""),
}

FEATURE_NAMES = tuple(_FEATURES)
"""The nine features of thesis 5.3.2, in its order, and four made of them.

``displacements`` are positions relative to the first point. The logarithms of speeds and distances
tell rest from movement and contact from distance, however wide a movement is.
"""

OBJECT_FEATURES = ("object_distance", "object_speed", "log_object_distance", "log_object_speed")
_PER_MARKER = {"positions": 3, "displacements": 3, "speeds": 1}
_ONCE = ("object_speed", "log_object_speed")


def count_channels(features: Sequence[str], markers: Sequence[str]) -> tuple[int, ...]:
    """Return how many channels each feature has."""
    n_arms = max(1, len({name.startswith("left_") for name in markers}))
    widths = {name: width * len(markers) for name, width in _PER_MARKER.items()}
    widths |= {"hand_orientation": 6 * n_arms} | dict.fromkeys(_ONCE, 1)
    return tuple(widths.get(name, n_arms) for name in features)


def extract_features(
    recording: LabelledRecording,
    bounds: npt.ArrayLike,
    features: Sequence[str],
    markers: Sequence[str],
    objects: Sequence[str] = (),
    n_points: int = 25,
) -> FloatArray:
    """Compute the features of segments of one recording.

    Parameters
    ----------
    recording : LabelledRecording
        The recording; the laboratory frame has z up.
    bounds : int array, shape (S, 2)
        Half-open rows of the segments.
    features : sequence of str
        Names out of `FEATURE_NAMES`.
    markers : sequence of str
        Markers whose positions and speeds are features.
    objects : sequence of str
        Markers on the object, for the features that need it.
    n_points : int
        Points that every segment is interpolated to by a cubic spline.

    Returns
    -------
    array, shape (S, n_points, C)
        Channels of all features in the order given: metres, metres per second, radians, radians
        per second, components of unit vectors.

    Raises
    ------
    RecognitionError
        If a feature or marker is unknown, a marker was not seen in a segment, or a segment is
        shorter than two samples or not inside the recording.

    References
    ----------
    Thesis 5.3.1 and 5.3.2.
    """
    unknown = [name for name in features if name not in _FEATURES]
    if unknown:
        raise RecognitionError(f"no feature {unknown[0]!r}; {nearest(unknown[0], FEATURE_NAMES)}")
    if not objects and set(features) & set(OBJECT_FEATURES):
        raise RecognitionError(
            f"{recording.source}: features {', '.join(OBJECT_FEATURES)} need markers on an object, "
            "got none"
        )
    body = find_body(recording.markers, recording.source)
    arms = body.arms_of(markers)
    stretch = cut_stretch(
        recording,
        bounds,
        _needed(features, arms, markers, objects),
        arms if "hand_orientation" in features else (),
        n_points,
    )._replace(arms=arms)
    try:
        values = stretch_features(stretch, features, markers, objects)
    except LabellingError as error:
        raise RecognitionError(f"{recording.source}: {error}") from None
    expected = sum(count_channels(features, markers))
    if values.shape[2] != expected:
        raise RecognitionError(
            f"{recording.source}: got {values.shape[2]} channels, expected {expected}: of the arms "
            f"of {', '.join(markers)} only that of {arms[0].hand} is complete"
        )
    return values


def stretch_features(
    stretch: Stretch, features: Sequence[str], markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    """Compute the features of segments that are cut out, see `extract_features`.

    Parameters
    ----------
    stretch : Stretch
        With its arms.
    features, markers, objects : sequence of str
        Known names; all markers are in the stretch.

    Returns
    -------
    array, shape (S, P, C)

    Raises
    ------
    LabellingError
        If markers of a hand stand in one line.
    """
    return np.concatenate(
        [_FEATURES[name][0](stretch, markers, objects) for name in features], axis=2
    )


def needed_markers(
    names: Sequence[str], features: Sequence[str], markers: Sequence[str], source: str
) -> tuple[str, ...]:
    """Return the markers on the person that `extract_features` needs, the back's included.

    Parameters
    ----------
    names : sequence of str
        Markers that there are.
    features, markers : sequence of str
        See `extract_features`.
    source : str
        Named in errors.

    Raises
    ------
    RecognitionError
        If the back cannot be found, or no arm is complete.
    """
    body = find_body(names, source)
    arms = body.arms_of(markers)
    hands = arms if "hand_orientation" in features else ()
    clusters = [name for arm in hands for name in arm.cluster]
    needed = _needed(features, arms, markers, ())
    return tuple(dict.fromkeys((*body.back, *needed, *clusters)))


def _needed(
    features: Sequence[str], arms: Sequence[Arm], markers: Sequence[str], objects: Sequence[str]
) -> tuple[str, ...]:
    """Return the markers that features need besides the back, each once."""
    needed: list[str] = []
    for feature in features:
        what = _FEATURES[feature][1]
        for arm in arms:
            needed += {"arm": arm.markers, "hand": (arm.hand,)}.get(what, ())
    if set(_PER_MARKER) & set(features):
        needed += markers
    if set(OBJECT_FEATURES) & set(features):
        needed += objects
    return tuple(dict.fromkeys(needed))
