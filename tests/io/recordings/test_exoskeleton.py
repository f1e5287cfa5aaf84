import shutil

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.config.resources import find_resource
from besman.exceptions import RecordingError
from besman.geometry.frames import quaternion_to_rotation
from besman.io.recordings.exoskeleton import read_joint_log, write_joint_log

URDF = find_resource("configs/exoskeleton", "dual_arm_example", ".urdf")
LINKS = {"shoulder": "shoulder", "elbow": "forearm", "wrist": "wrist"}
BODIES = {
    f"{side}_{body}": f"{side}_{link}" for side in ("right", "left") for body, link in LINKS.items()
}
MODEL = pinocchio.buildModelFromUrdf(str(URDF))
JOINTS = list(MODEL.names)[1:]

SMALL = """<robot name="small"><link name="base"/><link name="upper"/><link name="lower"/>
<link
name="slide"/><link name="tip"/>
<joint name="a" type="continuous"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 1" rpy="0.1 0.2 0.3"/><axis xyz="0 0.6 0.8"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="lower"/>
<origin xyz="0.3 0 0"/><axis xyz="0 0 -1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint><joint name="c" type="prismatic"><parent link="lower"/><child link="slide"/>
<origin xyz="0.1 0 0" rpy="0 1 0"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="d" type="fixed"><parent link="slide"/><child link="tip"/>
<origin xyz="0 0.2 0"/></joint>
</robot>
"""
LOG = """# urdf: small.urdf
# frames: shoulder=upper elbow=lower wrist=tip
time_s,a,b_deg,c
0.00,0.1,90,0.0
0.01,0.2,45,0.1
0.02,0.3,-45,0.2
"""


def write(folder, text, urdf=SMALL):
    (folder / "small.urdf").write_text(urdf)
    path = folder / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_positions_beside_pinocchio(tmp_path):
    rng = np.random.default_rng(0)
    angles = rng.uniform(MODEL.lowerPositionLimit, MODEL.upperPositionLimit, (50, MODEL.nq))
    path = tmp_path / "log.csv"
    write_joint_log(path, 3 + np.arange(50) / 100, angles, JOINTS, "dual_arm_example", BODIES)
    recording = read_joint_log(path)
    assert recording.names == tuple(BODIES)
    assert recording.rate_hz == 100
    np.testing.assert_allclose(recording.time, 3 + np.arange(50) / 100)
    rotations = quaternion_to_rotation(recording.orientations)
    data = MODEL.createData()
    for row, configuration in enumerate(np.round(angles, 6)):
        pinocchio.framesForwardKinematics(MODEL, data, configuration)
        for column, link in enumerate(BODIES.values()):
            pose = data.oMf[MODEL.getFrameId(link)]
            np.testing.assert_allclose(
                recording.positions[row, column], pose.translation, atol=1e-12
            )
            np.testing.assert_allclose(rotations[row, column], pose.rotation, atol=1e-12)


def test_limbs_of_the_example_keep_their_lengths(tmp_path):
    rng = np.random.default_rng(1)
    path = tmp_path / "log.csv"
    angles = rng.uniform(-1, 1, (20, MODEL.nq))
    write_joint_log(path, np.arange(20) / 100, angles, JOINTS, "dual_arm_example", BODIES)
    limbs = np.linalg.norm(np.diff(read_joint_log(path).positions, axis=1), axis=2)
    np.testing.assert_allclose(limbs[:, [0, 3]], 0.355)
    np.testing.assert_allclose(limbs[:, [1, 4]], 0.386)


def test_kinds_of_joints_and_degrees(tmp_path):
    recording = read_joint_log(write(tmp_path, LOG.replace("\n", "\r\n")))
    model = pinocchio.buildModelFromXML(SMALL)
    data = model.createData()
    values = [(0.1, np.pi / 2, 0.0), (0.2, np.pi / 4, 0.1), (0.3, -np.pi / 4, 0.2)]
    for row, (a, b, c) in enumerate(values):
        pinocchio.framesForwardKinematics(model, data, np.array([np.cos(a), np.sin(a), b, c]))
        np.testing.assert_allclose(
            recording.positions[row, 2], data.oMf[model.getFrameId("tip")].translation, atol=1e-12
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "no line of columns; is the file cut"),
        (lambda text: "# urdf: small.urdf\n", "log.csv:1: no line of columns"),
        (lambda text: text[: text.index("0.00,")], "log.csv:3: no rows after the columns"),
        (lambda text: text[:-9], "log.csv:6: got '0.02,0.3'; expected 4 numbers; is"),
        (lambda text: text[: text.index("0.01,")], "one row; expected at least two"),
        (lambda text: text.replace("time_s", "time"), "log.csv:3: columns 'time, a, b_deg, c'"),
        (lambda text: text.replace("b_deg", "a"), "expected time_s and one column a joint, each"),
        (lambda text: text.replace("b_deg", "a_deg"), "two columns for joint 'a'"),
        (lambda text: text.replace("b_deg", "bb"), "column 'bb': no such joint in the URDF; .*a"),
        (lambda text: text.replace("0.1,90", "0.1,nan"), "log.csv:4: got .* expected 4 numbers"),
        (lambda text: text.replace("0.01,", "nan,"), "log.csv:5: got .* expected 4 numbers"),
        (lambda text: text.replace("0.02,", "0.005,"), "log.csv:6: time is 0.005 s after 0.01 s"),
        (lambda text: text.replace("0.02,", "0.05,"), "log.csv:5: .* that rise evenly"),
        (lambda text: text.replace(",c\n", "\n").replace(",0.0\n", "\n").replace(",0.1\n", "\n")
         .replace(",0.2\n", "\n"), "no column for joint 'c', which moves wrist"),
        (lambda text: text.replace("# urdf: small.urdf\n", ""), "no comment '# urdf'"),
        (lambda text: text.replace("small.urdf", "../small.urdf"), "lies outside the folder"),
        (lambda text: text.replace("small.urdf", "/etc/x.urdf"), "lies outside the folder"),
        (lambda text: text.replace("small.urdf", "big.urdf"), "no file 'big.urdf' in the folder"),
        (lambda text: text.replace("small.urdf", "small"), "allowed: dual_arm_example"),
        (lambda text: text.replace("wrist=tip", "wrist"), "# frames: got 'wrist'; expected"),
        (lambda text: text.replace("wrist=tip", "hip=tip"), "# frames: got 'hip=tip'; expected"),
        (lambda text: text.replace("wrist=tip", "elbow=tip"), "got 'elbow=tip'; .* each once"),
        (lambda text: text.replace("# frames", "# links"), "no comment '# frames'"),
        (lambda text: text.replace("wrist=tip", "wrist=top"), "wrist=top: no such link .* 'tip'"),
        (lambda text: text.encode().replace(b"0.01", b"\xff\xfe"), "cannot be read as text"),
    ],
)  # fmt: skip
def test_bad_logs(tmp_path, change, message):
    with pytest.raises(RecordingError, match=message) as caught:
        read_joint_log(write(tmp_path, change(LOG)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        ("nonsense", "small.urdf is not a usable URDF: not valid XML: syntax error"),
        (SMALL[:300], "small.urdf is not a usable URDF"),
        ('<!DOCTYPE x [<!ENTITY a "b">]>' + SMALL, "document types and entities are not allowed"),
        (SMALL.replace("continuous", "floating"), "joint 'a' of the URDF has more than one axis"),
    ],
)
def test_bad_urdf(tmp_path, urdf, message):
    with pytest.raises(RecordingError, match=message) as caught:
        read_joint_log(write(tmp_path, LOG, urdf))
    assert "\n" not in str(caught.value)


def test_link_out_of_the_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    path = write(inside, LOG)
    shutil.move(inside / "small.urdf", tmp_path / "small.urdf")
    (inside / "small.urdf").symlink_to(tmp_path / "small.urdf")
    with pytest.raises(RecordingError, match="lies outside the folder of the log"):
        read_joint_log(path)


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        read_joint_log(tmp_path / "absent.csv")


@settings(max_examples=200, deadline=None)
@given(at=st.integers(0, len(LOG) - 1), text=st.text(max_size=3), length=st.integers(0, len(LOG)))
def test_damage_ends_in_one_line(tmp_path_factory, at, text, length):
    folder = tmp_path_factory.getbasetemp()
    damaged = LOG[:at] + text + LOG[at + len(text) :]
    try:
        read_joint_log(write(folder, damaged.encode("utf-8", "replace")[: max(length, at)]))
    except RecordingError as error:
        assert "\n" not in str(error)  # noqa: PT017
