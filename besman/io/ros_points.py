"""Where markers are by a ROS message: arrays of markers, clouds of points, poses, transforms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import RecordingError, nearest
from besman.records import FloatArray

Place = tuple[float, float, float]

UNNAMED = 64
"""Most points without a name in a message; others are left out."""

# Of visualization_msgs/Marker: a cube, a sphere, a cylinder; to be shown, as it is.
_SOLIDS, _ADD = (1, 2, 3), 0
_USE_INDEX = 1
# What topics of a body are called that say nothing of which.
_NO_NAMES = {"pose", "pose_stamped", "poses", "transform", "odom", "odometry"}


class Points(NamedTuple):
    """What a message says.

    Attributes
    ----------
    stamp_ns : int
        Of its header; 0 without.
    frame : str
        That places are in.
    places : dict of str to tuple of three floats, or array, shape (n, 3)
        By name, or in the order of the message; metres. What is hidden is not among them.
    known : tuple of str
        Names in the message, those of what is hidden among them.
    number : int, optional
        Of the frame, where the source counts.
    """

    stamp_ns: int
    frame: str
    places: dict[str, Place] | FloatArray
    known: tuple[str, ...] = ()
    number: int | None = None


Reader = Callable[[Any, str], Iterator[Points]]
"""Takes a message and what its topic is called."""


def stamp_of(message: Any) -> int:
    """Return the time in a message's header, nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _place(point: Any) -> Place:
    return float(point.x), float(point.y), float(point.z)


def read_marker_array(message: Any, _: str) -> Iterator[Points]:
    """Read ``visualization_msgs/MarkerArray``: a marker is called by its namespace.

    Where several are in one namespace a number follows; of markers without any, nothing is a name.
    """
    solids = [one for one in message.markers if one.type in _SOLIDS]
    if not solids:
        return
    spaces = [one.ns for one in solids]
    names = [
        one.ns if spaces.count(one.ns) == 1 else f"{one.ns}/{one.id}" if one.ns else ""
        for one in solids
    ]
    shown = [one.action == _ADD for one in solids]
    stamps = [stamp_of(one) for one, seen in zip(solids, shown, strict=True) if seen]
    stamp = max(stamps, default=stamp_of(solids[0]))
    frame = solids[0].header.frame_id
    if not all(names):
        # The columns are the numbers, which stay those of a trajectory.
        numbered = zip(solids, shown, strict=True)
        yield Points(
            stamp, frame, _by_number((one.id, one.pose.position) for one, seen in numbered if seen)
        )
        return
    places = {
        name: _place(one.pose.position)
        for name, one, seen in zip(names, solids, shown, strict=True)
        if seen
    }
    yield Points(stamp, frame, places, tuple(names))


def read_mocap_markers(message: Any, _: str) -> Iterator[Points]:
    """Read ``mocap4r2_msgs/Markers`` (``mocap_msgs/Markers`` before): by name, or by index."""
    number = int(message.frame_number)
    about = stamp_of(message), message.header.frame_id
    named = [one for one in message.markers if one.marker_name and one.id_type != _USE_INDEX]
    if message.markers and not named:
        places = _by_number((one.marker_index, one.translation) for one in message.markers)
        yield Points(*about, places, (), number)
        return
    found = {one.marker_name: _place(one.translation) for one in named}
    names = tuple(found)
    # What is hidden is at the origin, to the last bit, or no number.
    seen = {name: place for name, place in found.items() if any(place)}
    yield Points(*about, seen, names, number)


def read_cloud(message: Any, _: str) -> Iterator[Points]:
    """Read ``sensor_msgs/PointCloud``: points without a name."""
    places = np.array([_place(one) for one in message.points[:UNNAMED]]).reshape(-1, 3)
    yield Points(stamp_of(message), message.header.frame_id, places)


def read_pose(message: Any, name: str) -> Iterator[Points]:
    """Read ``geometry_msgs/PoseStamped``, with covariance or not: one body, called by its topic."""
    pose = getattr(message.pose, "pose", message.pose)
    places = {name: _place(pose.position)}
    yield Points(stamp_of(message), message.header.frame_id, places, (name,))


def read_point(message: Any, name: str) -> Iterator[Points]:
    """Read ``geometry_msgs/PointStamped``: one marker, called by its topic."""
    places = {name: _place(message.point)}
    yield Points(stamp_of(message), message.header.frame_id, places, (name,))


def read_transforms(message: Any, _: str) -> Iterator[Points]:
    """Read ``tf2_msgs/TFMessage`` or one ``TransformStamped``: bodies, called by their frames."""
    for one in getattr(message, "transforms", (message,)):
        name = one.child_frame_id.lstrip("/")
        places = {name: _place(one.transform.translation)}
        yield Points(stamp_of(one), one.header.frame_id, places, (name,))


def read_named_markers(message: Any) -> Iterator[Points]:
    """Read a message of one of `MARKERS`."""
    is_array = message.__msgtype__ == KINDS[1][0][0]
    yield from (read_marker_array if is_array else read_mocap_markers)(message, "")


def _by_number(numbered: Iterator[tuple[int, Any]]) -> FloatArray:
    """Return places in the rows of their numbers; NaN in those of none."""
    places = np.full((UNNAMED, 3), np.nan)
    for number, point in numbered:
        if 0 <= number < UNNAMED:
            places[number] = _place(point)
    return places


# What is of one message a frame comes first: where a bag has it, that is the markers.
KINDS: tuple[tuple[tuple[str, ...], Reader], ...] = (
    (("mocap4r2_msgs/msg/Markers", "mocap_msgs/msg/Markers"), read_mocap_markers),
    (("visualization_msgs/msg/MarkerArray",), read_marker_array),
    (("sensor_msgs/msg/PointCloud",), read_cloud),
    (
        ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"),
        read_pose,
    ),
    (("geometry_msgs/msg/PointStamped",), read_point),
    (("tf2_msgs/msg/TFMessage", "geometry_msgs/msg/TransformStamped"), read_transforms),
)
"""Types of messages that have markers, and what reads them; of several in a bag the first is meant.
"""

MARKERS = KINDS[0][0] + KINDS[1][0]
"""Those that name markers, each message a frame."""

WHOLE = 3
"""So many of `KINDS` are whole frames: a bag can only have one topic of them."""


def name_topics(topics: Sequence[str]) -> dict[str, str]:
    """Return what bodies are called by their topics: ``hand`` of ``/vrpn/hand/pose``."""
    short = {}
    for topic in topics:
        parts = [part for part in topic.split("/") if part]
        while len(parts) > 1 and parts[-1].lower() in _NO_NAMES:
            parts.pop()
        short[topic] = parts[-1] if parts else topic
    names = list(short.values())
    return {topic: one if names.count(one) == 1 else topic for topic, one in short.items()}


def choose_topics(
    kinds: dict[str, str], asked: tuple[str, ...], where: str
) -> tuple[dict[str, Reader], bool]:
    """Choose the topics that markers come by.

    Parameters
    ----------
    kinds : dict of str to str
        Type of each topic of the bag.
    asked : tuple of str
        Those that are meant; none: what `KINDS` has first.
    where : str
        For messages.

    Returns
    -------
    readers : dict of str to callable
        By topic.
    whole : bool
        Whether each message is a frame.

    Raises
    ------
    RecordingError
        If there is none, or several of which each would be all markers.
    """
    usable = _find_usable(kinds, asked, where)
    first = min(usable[topic] for topic in asked or usable)
    chosen = asked or tuple(topic for topic, rank in sorted(usable.items()) if rank == first)
    if first < WHOLE and len(chosen) > 1:
        raise RecordingError(
            f"{where}: {len(chosen)} topics have markers: {', '.join(chosen)}; say which: ?topic="
        )
    return {topic: KINDS[usable[topic]][1] for topic in chosen}, first < WHOLE


def _find_usable(kinds: dict[str, str], asked: tuple[str, ...], where: str) -> dict[str, int]:
    """Return the topics that have markers, and where in `KINDS` each stands."""
    ranks = {kind: rank for rank, (some, _) in enumerate(KINDS) for kind in some}
    usable = {
        topic: ranks[kind]
        for topic, kind in kinds.items()
        if kind in ranks and not topic.endswith("tf_static")
    }
    for topic in asked:
        if topic not in usable:
            raise RecordingError(
                f"{where}: no topic {topic!r:.60} of markers or poses; "
                + nearest(topic, usable or kinds)
            )
    if not usable:
        known = ", ".join(some[0].replace("/msg", "") for some, _ in KINDS)
        listed = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(kinds.items())[:12])
        raise RecordingError(
            f"{where}: no topic of markers; expected one of {known}; got {listed or 'nothing'}"
        )
    return usable
