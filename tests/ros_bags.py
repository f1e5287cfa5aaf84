"""Bags of ROS messages, written by the library itself and, as MCAP, by a second one."""

import shutil
from functools import cache

import numpy as np

EPOCH_NS = 1_700_000_000_000_000_000


def stamp_of(store, ns):
    return store.types["builtin_interfaces/msg/Time"](sec=int(ns // 10**9), nanosec=int(ns % 10**9))


@cache
def load_types(ros_1):
    """Return the library's types, which it compiles as they are first met."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if ros_1 else Stores.LATEST)


class Messages:
    """Messages of a typestore; times in nanoseconds, 0 for a header without one."""

    def __init__(self, ros_1=False):
        self.ros_1, self.store = ros_1, load_types(ros_1)

    def make(self, kind, **values):
        return self.store.types[kind](**values)

    def header(self, ns, frame="world"):
        extra = {"seq": 0} if self.ros_1 else {}
        return self.make(
            "std_msgs/msg/Header", stamp=stamp_of(self.store, ns), frame_id=frame, **extra
        )

    def joints(self, ns, names, positions):
        empty = np.zeros(0)
        return self.make(
            "sensor_msgs/msg/JointState", header=self.header(ns, ""), name=list(names),
            position=np.array(positions, dtype=np.float64), velocity=empty, effort=empty,
        )  # fmt: skip

    def turn(self, wxyz):
        w, x, y, z = map(float, wxyz)
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, ns, place, wxyz=(1, 0, 0, 0), frame="world"):
        x, y, z = map(float, place)
        pose = self.make(
            "geometry_msgs/msg/Pose", position=self.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
            orientation=self.turn(wxyz),
        )  # fmt: skip
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(ns, frame), pose=pose)

    def transform(self, ns, child, parent, place, wxyz=(1, 0, 0, 0)):
        x, y, z = map(float, place)
        return self.make(
            "geometry_msgs/msg/TransformStamped", header=self.header(ns, parent),
            child_frame_id=child, transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
                rotation=self.turn(wxyz),
            ),
        )  # fmt: skip

    def frames(self, *transforms):
        return self.make("tf2_msgs/msg/TFMessage", transforms=list(transforms))

    def text(self, text):
        return self.make("std_msgs/msg/String", data=text)


def write_bag(path, topics, compression=None):
    """Write ``{topic: [(log time in ns, message), ...]}``; the ending tells the container."""
    if path.suffix == ".bag":
        _write_ros_1(path, topics)
        return path
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = Messages().store
    mcap = path.suffix != ".db3"
    folder = path.with_name(f"{path.stem}_folder")
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        for topic, messages in topics.items():
            kind = messages[0][1].__msgtype__
            connection = writer.add_connection(topic, kind, typestore=store)
            for log_ns, message in messages:
                writer.write(connection, log_ns, store.serialize_cdr(message, kind))
    written = next(folder.glob("*.mcap" if mcap else "*.db3"))
    shutil.move(written, path)
    shutil.rmtree(folder)
    return path


def _write_ros_1(path, topics):
    from rosbags.rosbag1 import Writer

    store = Messages(ros_1=True).store
    with Writer(path) as writer:
        for topic, messages in topics.items():
            kind = messages[0][1].__msgtype__
            connection = writer.add_connection(topic, kind, typestore=store)
            for log_ns, message in messages:
                writer.write(connection, log_ns, store.serialize_ros1(message, kind))


def write_poses(recording, path):
    """Write the trajectories of a recording as poses that are not turned."""
    make = Messages(ros_1=path.suffix == ".bag")
    topics = {}
    for column, name in enumerate(recording.names):
        topics[f"/lab/{name}/pose"] = [
            (EPOCH_NS + round(1e9 * at), make.pose(EPOCH_NS + round(1e9 * at), place))
            for at, place in zip(recording.time, recording.positions[:, column], strict=True)
        ]
    return write_bag(path, topics)
