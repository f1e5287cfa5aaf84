"""Logs that other tools open: a person's markers, an arm's movements and events as ROS messages.

The extra ``ros``. As MCAP (Foxglove, PlotJuggler, ``ros2 bag``) or as a bag of rosbag2 (SQLite);
``rosbags`` writes both, without ROS.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import FileError, why_not_there
from besman.io.atomic_files import folder_aside, says_where, written_aside
from besman.io.exports import ros_joint_trajectory
from besman.io.log_content import Log, LoggedEvent, LoggedMarkers, LoggedMovement
from besman.io.message_rows import Blanks
from besman.records import FloatArray

IntArray = npt.NDArray[np.int64]

WORLD, LAB = "world", "lab"
"""Frames of the robot and of the person."""

MARKERS = "visualization_msgs/msg/MarkerArray"
"""Type of a person's markers."""

_DIAMETER_M = 0.03
_COLOUR = (0.12, 0.47, 0.71, 1.0)
# Of visualization_msgs/Marker; a marker that is not heard of for so long is gone.
_SPHERE, _ADD, _DELETE = 2, 0, 2
_LIFETIME_NS = 250_000_000
# Of rcl_interfaces/Log.
_INFO = 20
_NOTHING = np.zeros(0, np.uint8)
# Positions of markers and links, half of a micrometre true: what is shorter in its bits is
# compressed to less. Joints are written as they are.
_GRAIN_M = 2.0**-20


@dataclass
class _Topic:
    """A topic's type and messages: time in ns, bytes."""

    kind: str
    messages: list[tuple[int, bytes]] = field(default_factory=list)
    latched: bool = False


def write_mcap(log: Log, path: Path) -> None:
    """Write a log as one MCAP file, its chunks compressed by zstd; an existing one is replaced.

    Raises
    ------
    FileError
        If the library is not installed, or the file cannot be written.
    """
    topics = _Messages(path).topics(log)
    with says_where(path), TemporaryDirectory(prefix=".besman", dir=path.parent) as folder:
        bag = Path(folder) / "bag"
        _write(bag, topics, mcap=True)
        with written_aside(path) as temporary:
            next(bag.glob("*.mcap")).replace(temporary)


def write_rosbag2(log: Log, folder: Path) -> None:
    """Write a log as a bag of rosbag2: a folder with ``metadata.yaml`` and a SQLite database.

    Raises
    ------
    FileError
        If the library is not installed, the folder is there already, or cannot be written.
    """
    if folder.exists():
        raise FileError(f"{folder}: is there already; expected a folder that is not")
    topics = _Messages(folder).topics(log)
    with folder_aside(folder) as temporary:
        # The files bear the name of the folder that they are written to.
        bag = temporary / folder.name
        _write(bag, topics, mcap=False)
        for file in bag.iterdir():
            file.rename(temporary / file.name)
        bag.rmdir()


def _write(folder: Path, topics: dict[str, _Topic], mcap: bool) -> None:
    """Write messages in the order of time."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store = _load_store(folder)
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mcap:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        queue = []
        for number, (name, topic) in enumerate(topics.items()):
            connection = writer.add_connection(
                name, topic.kind, typestore=store, offered_qos_profiles=_qualities(topic.latched)
            )
            queue += [(at, number, connection, data) for at, data in topic.messages]
        queue.sort(key=lambda one: one[:2])
        for at, _, connection, data in queue:
            writer.write(connection, at, data)


def _qualities(latched: bool) -> list[Any]:
    """Return that who comes later gets the last message too, where a topic is latched."""
    if not latched:
        return []
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    long = QosTime(2147483647, 4294967295)
    return [
        Qos(
            QosHistory.KEEP_LAST,
            1,
            QosReliability.RELIABLE,
            QosDurability.TRANSIENT_LOCAL,
            long,
            long,
            QosLiveliness.AUTOMATIC,
            long,
            False,
        )
    ]


def _load_store(path: Path) -> Any:
    try:
        from rosbags.typesys import Stores
    except ImportError as error:
        reason = why_not_there(error, "rosbags", "besman[ros]")
        raise FileError(f"{path}: cannot be written: {reason}") from None
    return _load_types(Stores.ROS2_HUMBLE)


@cache
def _load_types(which: Any) -> Any:
    """Return the types of a ROS, which the library compiles as they are first met."""
    from rosbags.typesys import get_typestore

    return get_typestore(which)


def _nanoseconds(seconds: npt.ArrayLike) -> IntArray:
    return np.round(np.asarray(seconds, float) * 1e9).astype(np.int64)


def _to_grain(values: FloatArray) -> FloatArray:
    rounded: FloatArray = np.round(values / _GRAIN_M) * _GRAIN_M
    return rounded


def marker_messages(one: LoggedMarkers, path: Path) -> tuple[list[tuple[int, bytes]], str]:
    """Return markers as messages, one a frame, and the definition of their type.

    Parameters
    ----------
    one : LoggedMarkers
    path : Path
        Where they are to be written, for messages.

    Returns
    -------
    messages : list of (int, bytes)
        Time in nanoseconds, and `MARKERS` in the encoding of ROS 2.
    definition : str

    Raises
    ------
    FileError
        If the library is not installed.
    """
    definition, _ = _load_store(path).generate_msgdef(MARKERS, ros_version=2)
    return _Messages(path).markers(one), str(definition)


class _Messages:
    """Makes messages, by the definitions of a distribution of ROS that most tools know."""

    def __init__(self, path: Path) -> None:
        self._store = _load_store(path)

    def topics(self, log: Log) -> dict[str, _Topic]:
        """Return all topics of a log."""
        found = {"/tf_static": self._place_of_lab(log)}
        if log.markers:
            messages = [row for one in log.markers for row in self.markers(one)]
            found["/person/markers"] = _Topic(MARKERS, messages)
        for prefix, movements in log.movements.items():
            start = f"/{prefix}" if prefix else ""
            found[f"{start}/joint_trajectory"] = _Topic(
                "trajectory_msgs/msg/JointTrajectory", [self._trajectory(one) for one in movements]
            )
            states = [row for one in movements for row in self._states(one)]
            found[f"{start}/joint_states"] = _Topic("sensor_msgs/msg/JointState", states)
        frames = [
            row
            for prefix, movements in log.movements.items()
            for one in movements
            for row in self._transforms(one, f"{prefix}/" if prefix else "")
        ]
        found["/tf"] = _Topic("tf2_msgs/msg/TFMessage", frames)
        found["/events"] = _Topic("rcl_interfaces/msg/Log", [self._event(e) for e in log.events])
        return {name: topic for name, topic in found.items() if topic.messages}

    def _make(self, kind: str, *values: Any) -> Any:
        package, name = kind.split("/")
        return self._store.types[f"{package}/msg/{name}"](*values)

    def _bytes(self, message: Any) -> bytes:
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def _header(self, sec: int, nanosec: int, frame: str) -> Any:
        stamp = self._make("builtin_interfaces/Time", sec, nanosec)
        return self._make("std_msgs/Header", stamp, frame)

    def _blank_header(self, blanks: Blanks, at: IntArray, frame: str) -> Any:
        return self._header(blanks.whole(at // 10**9), blanks.whole(at % 10**9), frame)

    def _transform(self, header: Any, child: str, numbers: Iterable[float]) -> Any:
        x, y, z, *turn = numbers
        place = self._make("geometry_msgs/Vector3", x, y, z)
        turned = self._make("geometry_msgs/Quaternion", *turn)
        pose = self._make("geometry_msgs/Transform", place, turned)
        return self._make("geometry_msgs/TransformStamped", header, child, pose)

    def _place_of_lab(self, log: Log) -> _Topic:
        """Return that both worlds are drawn in one: where the person stood is not told by it."""
        starts = [float(one.time[0]) for one in log.markers]
        starts += [one.start_s for movements in log.movements.values() for one in movements]
        at = int(_nanoseconds(min(starts, default=0.0)))
        header = self._header(at // 10**9, at % 10**9, WORLD)
        message = self._transform(header, LAB, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        data = self._bytes(self._make("tf2_msgs/TFMessage", [message]))
        return _Topic("tf2_msgs/msg/TFMessage", [(at, data)], latched=True)

    def markers(self, one: LoggedMarkers) -> list[tuple[int, bytes]]:
        """Return one array of markers a frame."""
        make, at = self._make, _nanoseconds(one.time)
        blanks = Blanks(len(at))
        seen = np.asarray(np.isfinite(one.positions).all(axis=2))
        places = _to_grain(np.where(seen[..., np.newaxis], one.positions, 0.0))
        colour = make("std_msgs/ColorRGBA", *_COLOUR)
        scale = make("geometry_msgs/Vector3", *(_DIAMETER_M,) * 3)
        markers = []
        for column, name in enumerate(one.names):
            place = make(
                "geometry_msgs/Point", *(blanks.real(axis) for axis in places[:, column].T)
            )
            pose = make("geometry_msgs/Pose", place, make("geometry_msgs/Quaternion", 0, 0, 0, 1))
            action = blanks.whole(np.where(seen[:, column], _ADD, _DELETE))
            header = self._blank_header(blanks, at, LAB)
            lifetime = make("builtin_interfaces/Duration", 0, _LIFETIME_NS)
            picture = make("sensor_msgs/CompressedImage", self._header(0, 0, ""), "", _NOTHING)
            mesh = make("visualization_msgs/MeshFile", "", _NOTHING)
            # Trajectories without a name are told apart by their numbers.
            number = 0 if name else column
            shape = (
                header,
                name or "",
                number,
                _SPHERE,
                action,
                pose,
                scale,
                colour,
                lifetime,
                False,
            )
            rest: tuple[Any, ...] = [], [], "", picture, [], "", "", mesh, False
            markers.append(make("visualization_msgs/Marker", *shape, *rest))
        message = make("visualization_msgs/MarkerArray", markers)
        return list(zip(at.tolist(), blanks.fill(lambda: self._bytes(message)), strict=True))

    def _trajectory(self, one: LoggedMovement) -> tuple[int, bytes]:
        """Return a whole movement as one message."""
        plain = ros_joint_trajectory(*one.trajectory, one.joint_names)
        at, make = int(_nanoseconds(one.start_s)), self._make
        keys = ("positions", "velocities", "accelerations", "effort")
        points = [
            make(
                "trajectory_msgs/JointTrajectoryPoint",
                *(np.array(point[key], np.float64) for key in keys),
                make("builtin_interfaces/Duration", *point["time_from_start"].values()),
            )
            for point in plain["points"]
        ]
        header = self._header(at // 10**9, at % 10**9, "")
        message = make("trajectory_msgs/JointTrajectory", header, list(one.joint_names), points)
        return at, self._bytes(message)

    def _states(self, one: LoggedMovement) -> list[tuple[int, bytes]]:
        """Return joint states with positions and velocities."""
        time, positions, velocities, _ = (part[one.rows] for part in one.trajectory)
        at = _nanoseconds(one.start_s + time - one.trajectory[0][0])
        blanks = Blanks(len(at))
        columns = [
            np.array([blanks.real(joint) for joint in part.T]) for part in (positions, velocities)
        ]
        message = self._make(
            "sensor_msgs/JointState",
            self._blank_header(blanks, at, ""),
            list(one.joint_names),
            *columns,
            np.zeros(0),
        )
        return list(zip(at.tolist(), blanks.fill(lambda: self._bytes(message)), strict=True))

    def _transforms(self, one: LoggedMovement, prefix: str) -> list[tuple[int, bytes]]:
        """Return the poses of all frames, one message a sample."""
        at = _nanoseconds(one.start_s + one.trajectory[0][one.rows] - one.trajectory[0][0])
        poses = _to_grain(one.poses)
        blanks = Blanks(len(at))
        transforms = [
            self._transform(
                self._blank_header(blanks, at, WORLD),
                f"{prefix}{name}",
                [blanks.real(number) for number in poses[:, column].T],
            )
            for column, name in enumerate(one.frames)
        ]
        message = self._make("tf2_msgs/TFMessage", transforms)
        return list(zip(at.tolist(), blanks.fill(lambda: self._bytes(message)), strict=True))

    def _event(self, one: LoggedEvent) -> tuple[int, bytes]:
        at = int(_nanoseconds(one.time_s))
        stamp = self._make("builtin_interfaces/Time", at // 10**9, at % 10**9)
        message = self._make(
            "rcl_interfaces/Log",
            stamp,
            _INFO,
            "besman",
            one.label,
            one.source,
            one.kind,
            one.index,
        )
        return at, self._bytes(message)
