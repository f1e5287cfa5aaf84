"""Bags of ROS messages: what a library writes is read; a second one writes and reads them too."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError
from besman.io.recordings.formats import find_companions, read_recording
from besman.io.recordings.ros_bag import read_bag
from besman.standalone.look_files import look_at
from besman.standalone.look_text import find_next

pytest.importorskip("rosbags", reason="the extra ros is not installed")
import pinocchio
from places import SAMPLE
from ros_bags import EPOCH_NS, Messages, write_bag

URDF = """<robot name="arm"><link name="base_link"/><link name="upper_arm_link"/>
<link name="forearm_link"/><link name="tool0"/>
<joint name="pan" type="revolute"><parent link="base_link"/><child link="upper_arm_link"/>
<origin xyz="0 0 0.1"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint>
<joint name="lift" type="continuous"><parent link="upper_arm_link"/><child link="forearm_link"/>
<origin xyz="0.4 0 0.1"/><axis xyz="0 1 0"/></joint>
<joint name="wrist" type="revolute"><parent link="forearm_link"/><child link="tool0"/>
<origin xyz="0.3 0 0" rpy="0 1 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1"
velocity="1"/></joint></robot>"""
JOINTS = ["pan", "lift", "wrist"]
N = 60
STEP_NS = 10_000_000


def ns(k):
    return EPOCH_NS + k * STEP_NS


def angles(k):
    return np.array([0.5 * np.sin(0.1 * k), 0.1 * k, -0.4 * np.cos(0.07 * k)])


def joint_topic(make, stamped=True, order=JOINTS, rows=range(N)):
    places = [JOINTS.index(name) for name in order]
    return [
        (ns(k) + 2_000_000, make.joints(ns(k) if stamped else 0, order, angles(k)[places]))
        for k in rows
    ]


def described(make):
    return {"/robot_description": [(EPOCH_NS, make.text(URDF))]}


def expected_tool():
    model = pinocchio.buildModelFromXML(URDF)
    data, found = model.createData(), []
    for k in range(N):
        pan, lift, wrist = angles(k)
        q = np.array([pan, np.cos(lift), np.sin(lift), wrist])
        pinocchio.framesForwardKinematics(model, data, q)
        found.append(data.oMf[model.getFrameId("tool0")].homogeneous.copy())
    return np.array(found)


def assert_tool(recording, atol=1e-6):
    column = recording.names.index("tool0")
    poses = expected_tool()
    np.testing.assert_allclose(recording.positions[:, column], poses[:, :3, 3], atol=atol)
    turned = Rotation.from_quat(recording.orientations[:, column], scalar_first=True).as_matrix()
    np.testing.assert_allclose(turned, poses[:, :3, :3], atol=atol)


@pytest.mark.parametrize("ending", [".mcap", ".db3", ".bag"])
def test_joint_states_of_each_container(tmp_path, ending):
    make = Messages(ros_1=ending == ".bag")
    path = write_bag(
        tmp_path / f"a{ending}",
        {"/joint_states": joint_topic(make), **described(make),
         "/rosout": [(EPOCH_NS, make.text("hello"))]},
    )  # fmt: skip
    read = read_recording(path)
    assert read.names == ("base_link", "upper_arm_link", "forearm_link", "tool0")
    assert (read.rate_hz, len(read.time), read.time[0]) == (100.0, N, 0.0)
    assert_tool(read)
    assert read.origin.format == "ROS bag"
    assert "/joint_states (sensor_msgs/msg/JointState, 60 messages" in read.origin.notes[0]
    assert "/rosout (std_msgs/msg/String, 1 messages), not taken" in read.origin.notes[2]


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_what_a_second_library_writes(tmp_path, compression):
    writer_module = pytest.importorskip("mcap_ros2.writer")
    from mcap.writer import CompressionType

    definition = (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort\n" + 80 * "=" + "\nMSG: std_msgs/Header\n"
        "builtin_interfaces/Time stamp\nstring frame_id\n" + 80 * "=" +
        "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )  # fmt: skip
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = writer_module.Writer(
            file, chunk_size=2000, compression=CompressionType[compression.upper()]
        )
        kind = writer.register_msgdef("sensor_msgs/msg/JointState", definition)
        text = writer.register_msgdef("std_msgs/msg/String", "string data\n")
        writer.write_message("/robot_description", text, {"data": URDF}, log_time=EPOCH_NS)
        for k in range(N):
            stamp = {"sec": ns(k) // 10**9, "nanosec": ns(k) % 10**9}
            message = {
                "header": {"stamp": stamp, "frame_id": ""}, "name": JOINTS,
                "position": angles(k).tolist(), "velocity": [], "effort": [],
            }  # fmt: skip
            writer.write_message("/joint_states", kind, message, log_time=ns(k))
        writer.finish()
    assert_tool(read_recording(path))


def test_a_second_library_reads_what_the_tests_write(tmp_path):
    reader = pytest.importorskip("mcap_ros2.reader")
    make = Messages()
    path = write_bag(tmp_path / "a.mcap", {"/joint_states": joint_topic(make)})
    said = [one.ros_msg.position for one in reader.read_ros2_messages(str(path))]
    np.testing.assert_array_equal(said, [angles(k) for k in range(N)])


def test_order_doubles_other_columns_and_lost_messages(tmp_path):
    make = Messages()
    rows = joint_topic(make, order=["wrist", "pan", "lift"])
    (early, one), (late, other) = rows[10], rows[14]
    rows[10], rows[14] = (early, other), (late, one)
    rows.insert(20, rows[19])
    without = make.joints(ns(70), JOINTS, [])
    read = read_recording(
        write_bag(
            tmp_path / "a.mcap",
            {"/joint_states": [*rows, (ns(70), without)], **described(make)},
        )
    )
    assert_tool(read)
    said = " ".join(read.origin.notes)
    assert "1 joint states without positions" in said
    assert "of 3 joints or bodies were not in order" in said
    assert "3 values with the time of one before" in said
    kept = [row for k, row in enumerate(joint_topic(make)) if not 20 <= k < 40]
    gap = read_recording(write_bag(tmp_path / "b.mcap", {"/joint_states": kept, **described(make)}))
    hidden = np.isnan(gap.positions[:, -1, 0])
    assert hidden.sum() == 20
    assert hidden[20:40].all()


def test_times_of_logging_where_headers_have_none(tmp_path):
    make = Messages()
    topics = {"/joint_states": joint_topic(make, stamped=False), **described(make)}
    read = read_recording(write_bag(tmp_path / "a.mcap", topics))
    assert_tool(read)
    assert any("times are those of logging" in note for note in read.origin.notes)


def test_a_urdf_beside_the_bag(tmp_path):
    make = Messages()
    path = write_bag(tmp_path / "a.mcap", {"/joint_states": joint_topic(make)})
    with pytest.raises(RecordingError, match=r"no URDF, which tells.*or as a\.urdf beside it"):
        read_recording(path)
    (tmp_path / "other.urdf").write_text(URDF)
    assert find_companions(path) == (tmp_path / "other.urdf",)
    assert_tool(read_recording(path))
    (tmp_path / "other.urdf").write_text("<robot/>")
    with pytest.raises(RecordingError, match="the URDF is not a usable URDF"):
        read_recording(path)
    (tmp_path / "a.urdf").write_text(URDF.replace('name="lift"', 'name="tilt"'))
    read = read_recording(path)
    assert read.names == ("base_link", "upper_arm_link")
    assert "joints without values, whose links are left out: ['tilt']" in read.origin.notes[-1]
    (tmp_path / "a.urdf").write_text(
        URDF.replace('name="', 'name="x_').replace('link="', 'link="x_')
    )
    with pytest.raises(RecordingError, match=r"no joint of the URDF is on /joint_states; got pan"):
        read_recording(path)


def test_two_topics_of_joint_states(tmp_path):
    make = Messages()
    topics = {"/left": joint_topic(make), "/right": joint_topic(make), **described(make)}
    path = write_bag(tmp_path / "a.mcap", topics)
    with pytest.raises(
        RecordingError, match=r"2 topics of joint states: /left .*--topic, in a rec"
    ):
        read_recording(path)
    assert_tool(read_recording(path, topics=("/right",)))
    with pytest.raises(RecordingError, match="joint 'pan' is on two topics, /left and /right"):
        read_recording(path, topics=("/left", "/right"))
    with pytest.raises(RecordingError, match=r"no topic '/lefft' .*did you mean '/left'\?"):
        read_recording(path, topics=("/lefft",))


def test_a_bag_of_other_messages(tmp_path):
    make = Messages()
    path = write_bag(tmp_path / "a.mcap", {"/rosout": [(EPOCH_NS, make.text("hello"))]})
    with pytest.raises(RecordingError, match=r"no topic that can be used.*got /rosout \(std_msgs"):
        read_recording(path)


def tree(make, k, parent="world"):
    turn = Rotation.from_rotvec([0, 0, 0.05 * k]).as_quat(scalar_first=True)
    return [
        make.transform(ns(k), "base", parent, (0.1 * k, 0, 1)),
        make.transform(ns(k), "arm", "base", (0, 0.2, 0), turn),
    ]


def test_frames_are_followed_to_the_top(tmp_path):
    make = Messages()
    fixed = make.frames(make.transform(EPOCH_NS, "tip", "arm", (0.3, 0, 0)))
    topics = {
        "/tf": [(ns(k), make.frames(*tree(make, k))) for k in range(N)],
        "/tf_static": [(EPOCH_NS, fixed), (EPOCH_NS + 5, fixed)],
    }
    read = read_recording(write_bag(tmp_path / "a.mcap", topics))
    assert sorted(read.names) == ["arm", "base", "tip"]
    k = np.arange(N)
    expected = np.stack(
        [0.1 * k + 0.3 * np.cos(0.05 * k), 0.2 + 0.3 * np.sin(0.05 * k), np.ones(N)], axis=1
    )
    np.testing.assert_allclose(read.positions[:, read.names.index("tip")], expected, atol=1e-6)
    loop = {"/tf": [(ns(k), make.frames(*tree(make, k, "arm"))) for k in range(N)]}
    with pytest.raises(RecordingError, match="stands in a circle of frames"):
        read_recording(write_bag(tmp_path / "b.mcap", loop))


def poses(make, frame="world", rate=1):
    return [
        (ns(k), make.pose(ns(k), (0.01 * k, 0, 1), (0, 1, 0, 0), frame)) for k in range(0, N, rate)
    ]


def test_poses_are_bodies_called_by_their_topics(tmp_path):
    make = Messages()
    topics = {"/lab/hand/pose": poses(make), "/lab/elbow/pose": poses(make, rate=2)}
    read = read_recording(write_bag(tmp_path / "a.mcap", topics))
    assert sorted(read.names) == ["elbow", "hand"]
    for column in range(2):
        path = read.positions[: N - 1, column]
        np.testing.assert_allclose(path[:, 0], 0.01 * np.arange(N - 1), atol=1e-7)
    np.testing.assert_allclose(np.abs(read.orientations[:, 0]), [[0, 1, 0, 0]] * N, atol=1e-9)
    alike = {"/a/pose": poses(make), "/b/a/pose": poses(make)}
    assert sorted(read_recording(write_bag(tmp_path / "b.mcap", alike)).names) == [
        "/a/pose",
        "/b/a/pose",
    ]
    apart = {"/a": poses(make), "/b": poses(make, "camera")}
    path = write_bag(tmp_path / "c.mcap", apart)
    with pytest.raises(RecordingError, match=r"poses in 2 frames that nothing joins: 'b' in 'cam"):
        read_recording(path)
    assert read_recording(path, topics=("/a",)).names == ("a",)


def test_odometry_is_a_pose_with_its_covariance(tmp_path):
    make, zeros = Messages(), np.zeros(36)
    plain = poses(make)
    nothing = make.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = make.make("geometry_msgs/msg/Twist", linear=nothing, angular=nothing)
    motion = make.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=zeros)
    told = []
    for log_ns, message in plain:
        pose = make.make(
            "geometry_msgs/msg/PoseWithCovariance", pose=message.pose, covariance=zeros
        )
        told.append((log_ns, make.make("nav_msgs/msg/Odometry", header=message.header,
                     child_frame_id="body", pose=pose, twist=motion)))  # fmt: skip
    found = read_recording(write_bag(tmp_path / "a.mcap", {"/lab/hand/odom": told}))
    other = read_recording(write_bag(tmp_path / "b.mcap", {"/lab/hand/pose": plain}))
    assert found.names == other.names == ("hand",)
    np.testing.assert_array_equal(found.positions, other.positions)


def test_joints_that_nothing_turns_so_far(tmp_path):
    make = Messages()
    rows = joint_topic(make)
    rows[7] = ns(7) + 2_000_000, make.joints(ns(7), JOINTS, [0.0, 0.0, 1e308])
    path = write_bag(tmp_path / "a.mcap", {"/joint_states": rows, **described(make)})
    with pytest.raises(RecordingError, match=r"got 1e\+308; expected at most 1000 rad \(or m\)"):
        read_recording(path)


def test_times_that_lie_too_far_apart(tmp_path):
    make = Messages()
    rows = poses(make)
    rows[-1] = ns(N), make.pose(EPOCH_NS + 10**17 * 4, (0, 0, 1))
    path = write_bag(tmp_path / "a.mcap", {"/a": rows})
    with pytest.raises(RecordingError, match="are the times right"):
        read_recording(path)


def test_no_position_at_all(tmp_path):
    make = Messages()
    rows = [(ns(k), make.joints(ns(k), JOINTS, [])) for k in range(5)]
    path = write_bag(tmp_path / "a.mcap", {"/joint_states": rows, **described(make)})
    with pytest.raises(RecordingError, match="no message of /joint_states has positions"):
        read_recording(path)


def test_without_the_library(tmp_path, monkeypatch):
    make = Messages()
    path = write_bag(tmp_path / "a.mcap", {"/a": poses(make)})
    for name in ("rosbags", "rosbags.rosbag1", "rosbags.rosbag2"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(RecordingError, match=r"pip install 'besman\[ros\]'"):
        read_recording(path)


def test_damage_ends_in_one_line(tmp_path):
    make = Messages()
    rng = np.random.default_rng(0)
    for ending in (".mcap", ".db3"):
        content = write_bag(tmp_path / f"a{ending}", {"/a": poses(make)}).read_bytes()
        path = tmp_path / "damaged"
        for length in np.linspace(10, len(content) - 1, 12).astype(int):
            path.write_bytes(content[:length])
            with pytest.raises(RecordingError) as caught:
                read_recording(path)
            assert "\n" not in str(caught.value)
        for _ in range(30):
            damaged = bytearray(content)
            damaged[rng.integers(20, len(content))] = rng.integers(256)
            path.write_bytes(damaged)
            said = ""
            try:
                read_bag(path)
            except RecordingError as error:
                said = str(error)
            assert "\n" not in said


def test_look_names_the_set_of_arms(tmp_path):
    make = Messages()
    topics = {"/joint_states": joint_topic(make), **described(make)}
    look = look_at(write_bag(tmp_path / "a.mcap", topics))
    assert look.best.marker_set.name == "robot_arm"
    assert look.best.is_complete
    assert not look.fault
    assert "label.markers=robot_arm" in find_next(look, [])[-1]


def test_poses_that_are_none_are_gaps(tmp_path):
    make = Messages()
    rows = poses(make)
    rows[20:40] = [
        (log_ns, make.pose(log_ns, (np.nan, 0, 1) if k % 2 else (0, 0, 1), (0, 0, 0, 0)))
        for k, (log_ns, _) in enumerate(rows[20:40])
    ]
    blind = [(log_ns, make.pose(log_ns, (np.nan, 0, 0))) for log_ns, _ in rows]
    read = read_recording(write_bag(tmp_path / "a.mcap", {"/hand": rows, "/blind": blind}))
    assert read.names == ("hand",)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(read.positions[:, 0, 0])), range(20, 40))


def test_markers_with_names_are_read_as_they_are_followed(tmp_path):
    """Of a type that the library does not know too: its definition stands in the file."""
    from growing_bags import MOCAP, MOCAP_DEFINITION, McapWriter
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from besman.live.play_mcap import play_as_mcap
    from besman.live.play_qtm import Delays

    given = read_recording(SAMPLE / "subject1.tsv")
    given = replace(given, time=given.time[:60], positions=given.positions[:60].copy())
    played = tmp_path / "played.mcap"
    play_as_mcap(given, played, Delays(pace=1000.0))
    read = read_recording(played)
    assert (read.names, read.rate_hz, read.orientations) == (given.names, 100.0, None)
    np.testing.assert_allclose(read.positions, given.positions, atol=1e-6)
    store = get_typestore(Stores.EMPTY)
    types = get_types_from_msg(MOCAP_DEFINITION, MOCAP)
    store.register({name: one for name, one in types.items() if name not in store.types})
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    for by_name in (True, False):
        path = tmp_path / f"mocap_{by_name}.mcap"
        writer = McapWriter(path)
        for row in range(30):
            at = EPOCH_NS + row * 10**7
            markers = [
                make["Marker"](0, k, name if by_name else "", make["Point"](0.01 * row, k, 1))
                for k, name in enumerate(("hand", "elbow"))
            ]
            header = make["Header"](make["Time"](at // 10**9, at % 10**9), "map")
            data = bytes(store.serialize_cdr(make["Markers"](header, row, markers), MOCAP))
            writer.write("/markers", MOCAP, MOCAP_DEFINITION, at, data)
        writer.finish()
        if not by_name:
            with pytest.raises(RecordingError, match="/markers: markers without names"):
                read_recording(path)
            continue
        read = read_recording(path)
        assert read.names == ("hand", "elbow")
        np.testing.assert_allclose(
            read.positions, [[[0.01 * row, k, 1.0] for k in range(2)] for row in range(30)]
        )


def test_two_topics_of_markers(tmp_path):
    make = Messages()
    array = make.make("visualization_msgs/msg/MarkerArray", markers=[])
    rows = [(EPOCH_NS + k * 10**7, array) for k in range(3)]
    path = write_bag(tmp_path / "a.mcap", {"/one": rows, "/two": rows})
    with pytest.raises(RecordingError, match=r"2 topics of markers: /one .*choose with --topic"):
        read_recording(path)
