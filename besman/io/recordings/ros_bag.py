"""Bags of ROS messages: joint states of an arm or exoskeleton, and poses of bodies.

MCAP and SQLite files of ROS 2 (a bag's folder holds them), with chunks compressed by zstd or lz4 or
not, and bags of ROS 1; read by ``rosbags`` (extra ``ros``), no ROS is needed. Taken are

- ``visualization_msgs/MarkerArray`` and ``mocap4r2_msgs/Markers``: markers with their names, as
  `besman.io.ros_points` reads them and besman writes a person's;
- ``sensor_msgs/JointState``, with the URDF on a topic ``robot_description`` or in a file beside the
  bag: where all links of the arm were, by their names, in the frame of the URDF's root;
- ``geometry_msgs/PoseStamped``, ``PoseWithCovarianceStamped`` and ``nav_msgs/Odometry``, a body
  each, called by its topic (``/vrpn/hand/pose`` is ``hand``), ``TransformStamped`` and
  ``tf2_msgs/TFMessage`` (``/tf`` and ``/tf_static``), called by their frames, in the frame above
  them all.

Times are those of the headers, of topics without any those of logging. All is brought to even
times, at the rate of the fastest topic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, nearest
from besman.io.recordings.bodies import from_matrices
from besman.io.recordings.format import READING
from besman.io.recordings.ros_tracks import Grid, Track, compose_tree, find_grid, sample_values
from besman.io.ros_messages import Bag, Topic, open_bag
from besman.io.ros_points import MARKERS, name_topics, read_named_markers, stamp_of
from besman.records import Origin, Recording
from besman.records.frozen import hand_over

_JOINTS = "sensor_msgs/msg/JointState"
_POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "nav_msgs/msg/Odometry",
)
_FRAMES = ("geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_TAKEN = (_JOINTS, *MARKERS, *_POSES, *_FRAMES)
_TEXT = "std_msgs/msg/String"
_KNOWN = "joint states, markers, poses or transforms"
_MOST_LISTED = 12
# No joint turns or slides farther.
_GREATEST = 1000.0
_CHOOSE = "choose with --topic, in a recipe with read.topics"


def read_bag(path: Path) -> Recording:
    """Read a bag.

    Parameters
    ----------
    path : Path
        The file. Topics are chosen by `besman.io.recordings.format.reading`.

    Returns
    -------
    Recording
        One trajectory a link or body, with orientations; time from 0. Its `origin` lists the
        topics.

    Raises
    ------
    RecordingError
        If the library is not installed, the file is cut or damaged, no topic fits or several do, or
        joint states come without a URDF or its joints.
    """
    with open_bag(path) as bag:
        described = find_description(bag, path)
        chosen = _choose(bag.topics, READING.get().topics, described is not None, path)
        gathered = _Gathered(path)
        gathered.take(bag, chosen)
    if chosen[0].kind == _JOINTS:
        return _follow_joints(gathered, described, bag.topics, chosen)
    return _follow_bodies(gathered, bag.topics, chosen)


def read_joint_states(path: Path) -> dict[str, Track]:
    """Read the angles of joints as they were told, by their names; no URDF is needed.

    Parameters
    ----------
    path : Path
        The bag. Topics are chosen by `besman.io.recordings.format.reading`.

    Returns
    -------
    dict of Track
        In the order of the messages.

    Raises
    ------
    RecordingError
        If the bag cannot be read, or has no joint states, or several topics of them.
    """
    gathered = _Gathered(path)
    with open_bag(path) as bag:
        joints = [one for one in bag.topics if one.kind == _JOINTS and one.n_messages]
        if not joints:
            raise RecordingError(f"{path}: no topic of joint states; got {_list(bag.topics)}")
        asked = READING.get().topics
        gathered.take(bag, _choose(joints, asked, True, path))
    return gathered.tracks


def find_bag_files(path: Path) -> tuple[Path, ...]:
    """Return the files that a bag may be read with: a URDF beside it."""
    found = _urdf_beside(path)
    return () if found is None else (found,)


def find_description(bag: Bag, path: Path) -> str | None:
    """Return the URDF on a topic of the bag, or in the file beside it; None without."""
    topics = [
        one
        for one in bag.topics
        if one.kind == _TEXT and one.name.endswith("robot_description") and one.n_messages
    ]
    for _, _, message in bag.read(topics):
        return str(message.data)
    beside = _urdf_beside(path)
    try:
        return None if beside is None else beside.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: {beside}: cannot be read: {error}") from None


def _urdf_beside(path: Path) -> Path | None:
    """Return the URDF that is called like the bag, else the only one of the folder."""
    own = path.with_suffix(".urdf")
    if own.is_file():
        return own
    others = sorted(path.parent.glob("*.urdf"))
    return others[0] if len(others) == 1 else None


def _choose(
    topics: Sequence[Topic], asked: Collection[str], has_urdf: bool, path: Path
) -> list[Topic]:
    """Choose the topics: joint states, or else all poses."""
    usable = [one for one in topics if one.kind in _TAKEN and one.n_messages]
    if asked:
        usable = _take_asked(usable, asked, path)
    if not usable:
        raise RecordingError(
            f"{path}: no topic that can be used; expected {_KNOWN}; got {_list(topics)}"
        )
    joints = [one for one in usable if one.kind == _JOINTS]
    markers = [one for one in usable if one.kind in MARKERS]
    poses = [one for one in usable if one.kind != _JOINTS]
    if markers and not (joints and has_urdf):
        return _refuse_several(markers, "markers", asked, path)
    if not joints or (poses and not has_urdf):
        return poses
    if not has_urdf:
        raise RecordingError(
            f"{path}: {joints[0]} and no URDF, which tells where the joints are; expected it on a "
            f"topic robot_description, or as {path.with_suffix('.urdf').name} beside it"
        )
    return _refuse_several(joints, "joint states", asked, path)


def _refuse_several(
    topics: list[Topic], what: str, asked: Collection[str], path: Path
) -> list[Topic]:
    """Return the topics; refuse several of a kind of which nobody has asked for any."""
    if len(topics) > 1 and not asked:
        raise RecordingError(f"{path}: {len(topics)} topics of {what}: {_list(topics)}; {_CHOOSE}")
    return topics


def _take_asked(usable: Sequence[Topic], asked: Collection[str], path: Path) -> list[Topic]:
    """Return the topics that were asked for."""
    names = [one.name for one in usable]
    for name in asked:
        if name not in names:
            raise RecordingError(
                f"{path}: --topic: no topic {name!r:.60} of joint states or poses; "
                + nearest(name, names)
            )
    return [one for one in usable if one.name in asked]


def _list(topics: Sequence[Topic]) -> str:
    """List topics, the first of many."""
    more = f" and {len(topics) - _MOST_LISTED} more" if len(topics) > _MOST_LISTED else ""
    return (", ".join(map(str, topics[:_MOST_LISTED])) or "nothing") + more


class _Gathered:
    """What the messages of the chosen topics say, by joint or body."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tracks: dict[str, Track] = {}
        self.notes: list[str] = []
        self._owners: dict[str, str] = {}
        self._logged: dict[str, list[int]] = {}
        self._n_empty = 0

    def take(self, bag: Bag, topics: Sequence[Topic]) -> None:
        """Read the messages of topics."""
        names = name_topics([one.name for one in topics if one.kind in _POSES])
        takers: dict[str, Callable[[str, int, Any], None]] = {
            _JOINTS: self._take_joints,
            **dict.fromkeys(MARKERS, self._take_markers),
            **dict.fromkeys(_FRAMES, self._take_frames),
            **dict.fromkeys(_POSES, self._take_pose),
        }
        kinds = {one.name: takers[one.kind] for one in topics}
        for topic, log_ns, message in bag.read(topics):
            kinds[topic](names.get(topic, topic), log_ns, message)
        self.tracks = {name: one for name, one in self.tracks.items() if one.is_seen}
        if self._n_empty:
            self.notes.append(f"{self._n_empty} joint states without positions are left out")
        if not self.tracks:
            raise RecordingError(f"{self.path}: no message of {', '.join(kinds)} has positions")
        self._settle_times()

    def _add(self, name: str, stamp_ns: int, log_ns: int, values: Any) -> Track:
        """Add a value with its times."""
        track = self.tracks.get(name)
        if track is None:
            track = self.tracks[name] = Track()
            self._logged[name] = []
        track.stamps.append(stamp_ns)
        track.values.append(values)
        self._logged[name].append(log_ns)
        return track

    def _take_joints(self, topic: str, log_ns: int, message: Any) -> None:
        """Take a joint state; positions may be missing beside velocities."""
        names, values = message.name, message.position
        if len(values) < len(names) or not names:
            self._n_empty += 1
            return
        for name, value in zip(names, values.tolist(), strict=False):
            owner = self._owners.setdefault(name, topic)
            if owner != topic:
                raise RecordingError(
                    f"{self.path}: joint {name!r:.60} is on two topics, {owner} and {topic}; "
                    + _CHOOSE
                )
            self._add(name, stamp_of(message), log_ns, value)

    def _take_markers(self, topic: str, log_ns: int, message: Any) -> None:
        """Take the markers of a frame that are seen."""
        for one in read_named_markers(message):
            if not isinstance(one.places, dict):
                raise RecordingError(
                    f"{self.path}: {topic}: markers without names, of which no trajectories are "
                    "made; expected a name of each"
                )
            for name, place in one.places.items():
                track = self._add(name, one.stamp_ns, log_ns, (*place, 0.0, 0.0, 0.0, 1.0))
                track.parent = one.frame.lstrip("/")

    def _take_frames(self, topic: str, log_ns: int, message: Any) -> None:
        """Take one transform or several; one that stands still is told again and again."""
        for one in getattr(message, "transforms", (message,)):
            name = one.child_frame_id.lstrip("/")
            if topic.endswith("tf_static"):
                self.tracks.pop(name, None)
                self._logged.pop(name, None)
            values = _pose_of(one.transform.translation, one.transform.rotation)
            track = self._add(name, stamp_of(one), log_ns, values)
            track.parent = one.header.frame_id.lstrip("/")

    def _take_pose(self, name: str, log_ns: int, message: Any) -> None:
        """Take a pose, with its covariance or without."""
        pose = getattr(message.pose, "pose", message.pose)
        values = _pose_of(pose.position, pose.orientation)
        track = self._add(name, stamp_of(message), log_ns, values)
        track.parent = message.header.frame_id.lstrip("/")

    def _settle_times(self) -> None:
        """Take the times of logging of all, where a header has none: clocks may differ."""
        moving = {name: one for name, one in self.tracks.items() if len(one.stamps) > 1}
        unstamped = [name for name, one in moving.items() if min(one.stamps) <= 0]
        if unstamped:
            for name, track in self.tracks.items():
                track.stamps = self._logged[name]
            self.notes.append(
                f"times are those of logging: headers of {unstamped[0]!r:.60} have none"
            )
        n_twice = sum(one.arrays()[2] for one in moving.values())
        n_turned = sum(bool(np.any(np.diff(one.stamps) < 0)) for one in moving.values())
        if n_turned:
            self.notes.append(f"messages of {n_turned} joints or bodies were not in order of time")
        if n_twice:
            self.notes.append(f"{n_twice} values with the time of one before are left out")


def _pose_of(position: Any, turn: Any) -> tuple[float, ...]:
    """Return position and quaternion (w last); NaN where that is none."""
    values = (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
    # Squares of what is much larger overflow.
    if not all(abs(one) < 2.0 for one in values[3:]):
        return (np.nan,) * 7
    return values if 0.5 < math.hypot(*values[3:]) < 2.0 else (np.nan,) * 7


def _follow_joints(
    gathered: _Gathered, described: str | None, topics: Iterable[Topic], chosen: Sequence[Topic]
) -> Recording:
    """Return where the links of the URDF were."""
    import pinocchio

    from besman.io.recordings.exoskeleton_kinematics import link_poses, parse_exoskeleton_model

    path = gathered.path
    model = parse_exoskeleton_model(described or "", "the URDF", path)
    grid = find_grid(gathered.tracks.values(), str(path))
    angles = {}
    for name in list(model.names)[1:]:
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise RecordingError(f"{path}: joint {name!r} of the URDF has more than one axis")
        track = gathered.tracks.get(name)
        if track is not None:
            if joint.nq == 2:
                track.values = np.unwrap(track.values).tolist()
            _refuse_far(track, name, path)
            angles[name] = sample_values(track, grid)
    if not angles:
        raise RecordingError(
            f"{path}: no joint of the URDF is on {', '.join(one.name for one in chosen)}; got "
            f"{', '.join(gathered.tracks)}; expected {', '.join(list(model.names)[1:])}"
        )
    links = tuple(
        frame.name
        for frame in model.frames
        if frame.type == pinocchio.FrameType.BODY
        and all(
            model.names[joint] in angles for joint in model.supports[frame.parentJoint] if joint
        )
    )
    without = [name for name in list(model.names)[1:] if name not in angles]
    if without:
        gathered.notes.append(f"joints without values, whose links are left out: {without}")
    turned, places = link_poses(model, angles, links)
    return _record(gathered, grid, links, (turned, places), topics, chosen)


def _refuse_far(track: Track, name: str, path: Path) -> None:
    """Refuse a joint that nothing turns so far."""
    greatest = float(np.abs(track.arrays()[1]).max(initial=0.0))
    if greatest > _GREATEST:
        raise RecordingError(
            f"{path}: joint {name!r:.60}: got {greatest:g}; expected at most {_GREATEST:g} rad "
            "(or m)"
        )


def _follow_bodies(
    gathered: _Gathered, topics: Iterable[Topic], chosen: Sequence[Topic]
) -> Recording:
    """Return where bodies were in the frame above them all."""
    path = gathered.path
    grid = find_grid(gathered.tracks.values(), str(path))
    poses = compose_tree(gathered.tracks, grid, str(path))
    turned = np.stack([one[0] for one in poses.values()], axis=1)
    places = np.stack([one[1] for one in poses.values()], axis=1)
    return _record(gathered, grid, tuple(poses), (turned, places), topics, chosen)


def _record(
    gathered: _Gathered,
    grid: Grid,
    names: tuple[str, ...],
    poses: tuple[Any, Any],
    topics: Iterable[Topic],
    chosen: Sequence[Topic],
) -> Recording:
    """Make a recording, with what is in the bag as notes."""
    taken = {one.name for one in chosen}
    listed = [f"topic {one}{'' if one.name in taken else ', not taken'}" for one in topics]
    turned, places = poses
    # One sample that is not a number makes none of a body.
    hidden = ~(np.isfinite(turned).all(axis=(2, 3)) & np.isfinite(places).all(axis=2))
    places = np.where(hidden[..., None], np.nan, places)
    return Recording(
        time=grid.time,
        positions=hand_over(places),
        names=names,
        rate_hz=grid.rate_hz,
        source=gathered.path.name,
        orientations=None
        if chosen[0].kind in MARKERS
        else from_matrices(np.where(hidden[..., None, None], np.nan, turned)),
        origin=Origin(notes=(*listed, *gathered.notes)),
    )
