"""Logs as ROS messages, read back by another library than the one that wrote them."""

import sys
from collections import defaultdict

import numpy as np
import pytest
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from besman.exceptions import FileError
from besman.io.log_content import Log, LoggedEvent, LoggedMarkers, LoggedMovement
from besman.io.ros_logs import write_mcap, write_rosbag2

JOINTS = ("a_joint", "b_joint")
# What positions are rounded to.
HALF_A_GRAIN = 2.0**-21


@pytest.fixture(scope="module")
def log():
    draw = np.random.default_rng(0)
    positions = draw.normal(size=(20, 3, 3))
    positions[5, 1] = np.nan
    time = np.arange(51) / 1000
    trajectory = (time, *(draw.normal(size=(51, 2)) for _ in range(3)))
    rows = np.arange(0, 51, 10)
    poses = draw.normal(size=(6, 4, 7))
    movement = LoggedMovement(
        1.25, trajectory, JOINTS, rows, ("base", "link_1", "link_2", "tcp"), poses
    )
    markers = LoggedMarkers(1.0 + np.arange(20) / 100, positions, ("elbow", "hand_top", "stick"))
    events = (
        LoggedEvent(1.0, "idle", "block", "x.tsv", 0),
        LoggedEvent(1.25, "Wurf, schnell", "motion", "x.tsv:1", 0),
    )
    return Log([markers], {"": [movement]}, events)


@pytest.fixture(scope="module")
def topics(log, tmp_path_factory):
    """Messages of the MCAP file by topic, with their time in seconds."""
    path = tmp_path_factory.mktemp("mcap") / "log.mcap"
    write_mcap(log, path)
    assert [one.name for one in path.parent.iterdir()] == ["log.mcap"]
    found = defaultdict(list)
    for message in read_ros2_messages(str(path)):
        found[message.channel.topic].append((message.log_time_ns * 1e-9, message.ros_msg))
    return found


def test_markers_are_where_they_were_and_deleted_where_not_seen(log, topics):
    (one,) = log.markers
    messages = topics["/person/markers"]
    np.testing.assert_allclose([at for at, _ in messages], one.time, atol=1e-9)
    for row, (_, message) in enumerate(messages):
        assert tuple(marker.ns for marker in message.markers) == one.names
        stamp = message.markers[0].header.stamp
        assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(one.time[row], abs=1e-9)
        for column, marker in enumerate(message.markers):
            hidden = np.isnan(one.positions[row, column]).any()
            assert marker.action == (2 if hidden else 0)
            assert (marker.type, marker.header.frame_id) == (2, "lab")
            if not hidden:
                place = marker.pose.position
                np.testing.assert_allclose(
                    [place.x, place.y, place.z], one.positions[row, column], atol=HALF_A_GRAIN
                )


def test_a_movement_is_a_trajectory_states_and_transforms(log, topics):
    (one,) = log.movements[""]
    ((at, message),) = topics["/joint_trajectory"]
    assert at == pytest.approx(one.start_s)
    assert tuple(message.joint_names) == JOINTS
    for key, expected in zip(
        ("positions", "velocities", "accelerations"), one.trajectory[1:], strict=True
    ):
        np.testing.assert_array_equal([getattr(p, key) for p in message.points], expected)
    spent = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
    np.testing.assert_allclose(spent, one.trajectory[0], atol=1e-9)
    expected_at = one.start_s + one.trajectory[0][one.rows]
    for topic in ("/joint_states", "/tf"):
        np.testing.assert_allclose([at for at, _ in topics[topic]], expected_at, atol=1e-9)
    states = [state for _, state in topics["/joint_states"]]
    np.testing.assert_array_equal([s.position for s in states], one.trajectory[1][one.rows])
    np.testing.assert_array_equal([s.velocity for s in states], one.trajectory[2][one.rows])
    for (_, message), poses in zip(topics["/tf"], one.poses, strict=True):
        for transform, frame, pose in zip(message.transforms, one.frames, poses, strict=True):
            assert (transform.header.frame_id, transform.child_frame_id) == ("world", frame)
            moved, turned = transform.transform.translation, transform.transform.rotation
            found = [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w]
            np.testing.assert_allclose(found, pose, atol=HALF_A_GRAIN)
    ((_, static),) = topics["/tf_static"]
    assert static.transforms[0].child_frame_id == "lab"


def test_events_say_what_began(log, topics):
    found = [(at, m.msg, m.function, m.file, m.line) for at, m in topics["/events"]]
    assert found == [(e.time_s, e.label, e.kind, e.source, e.index) for e in log.events]


def test_a_bag_holds_the_same_and_same_input_gives_same_bytes(log, topics, tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_rosbag2(log, tmp_path / name / "log")
        write_mcap(log, tmp_path / name / "log.mcap")
    for name in ("log/log.db3", "log/metadata.yaml", "log.mcap"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    bag = tmp_path / "one" / "log"
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        counts = {one.topic: one.msgcount for one in reader.connections}
        assert counts == {topic: len(messages) for topic, messages in topics.items()}
        (states,) = [one for one in reader.connections if one.topic == "/joint_states"]
        positions = [
            reader.deserialize(data, states.msgtype).position
            for _, _, data in reader.messages([states])
        ]
    (movement,) = log.movements[""]
    np.testing.assert_array_equal(positions, movement.trajectory[1][movement.rows])


def test_two_arms_have_topics_and_frames_of_their_own(log, tmp_path):
    (movement,) = log.movements[""]
    write_mcap(Log(movements={"first": [movement], "second": [movement]}), tmp_path / "two.mcap")
    messages = list(read_ros2_messages(str(tmp_path / "two.mcap")))
    topics = {message.channel.topic for message in messages}
    assert topics == {
        "/tf", "/tf_static", "/first/joint_states", "/second/joint_states",
        "/first/joint_trajectory", "/second/joint_trajectory",
    }  # fmt: skip
    frames = {
        transform.child_frame_id
        for message in messages
        if message.channel.topic == "/tf"
        for transform in message.ros_msg.transforms
    }
    assert frames == {f"{arm}/{name}" for arm in ("first", "second") for name in movement.frames}


def test_what_cannot_be_written_is_one_line_and_nothing_stays(log, tmp_path, monkeypatch):
    (tmp_path / "log").mkdir()
    with pytest.raises(FileError, match=r"log: is there already; expected a folder that is not"):
        write_rosbag2(log, tmp_path / "log")
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(FileError, match=r"a\.mcap: cannot be written: rosbags"):
        write_mcap(log, tmp_path / "a.mcap")
    assert [one.name for one in tmp_path.iterdir()] == ["log"]
