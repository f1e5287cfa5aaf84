# ruff: noqa: E501
"""Skeletons whose joints are followed by a second library's rotations."""

from itertools import permutations

import numpy as np
import pytest
from foreign_recordings import bvh_lines, write_lines
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.bvh import read_bvh
from besman.io.recordings.format import reading
from besman.io.recordings.formats import read_recording
from besman.records import Recording

CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
RNG = np.random.default_rng(0)
# Name, parent, offset; ends of the skeleton have no channels.
TREE = [
    ("Hips", -1, (0, 0, 0)), ("Spine", 0, (0, 25, 1)), ("Head", 1, (0, 40, 2)), ("Head_end", 2, (0, 15, 0)),
    ("LeftArm", 1, (20, 30, 0)), ("LeftArm_end", 4, (60, 0, 0)), ("LeftLeg", 0, (10, -45, 0)),
    ("LeftFoot", 6, (0, -45, 0)), ("LeftFoot_end", 7, (0, -5, 15)),
]  # fmt: skip


def tree_lines(orders, scale=1.0, brace="\n"):
    """The hierarchy, with rotations in an order of its own for each joint."""
    lines = ["HIERARCHY"]

    def add(index):
        name, parent, offset = TREE[index]
        is_end = name.endswith("_end")
        kind = "End Site" if is_end else f"{'ROOT' if parent < 0 else 'JOINT'} {name}"
        lines.extend([f"{kind} {{"] if brace == " " else [kind, "{"])
        lines.append("\tOFFSET " + " ".join(f"{scale * one:.6f}" for one in offset))
        if not is_end:
            words = ["Xposition", "Yposition", "Zposition"] if parent < 0 else []
            words += [f"{axis}rotation" for axis in orders[index]]
            lines.append(f"\tCHANNELS {len(words)} {' '.join(words)}")
        for child, (_, owner, _) in enumerate(TREE):
            if owner == index:
                add(child)
        lines.append("}")

    add(0)
    return lines


def motion(orders, n_frames, scale=1.0):
    """Channels (T, N) in the order of the tree, and what they make of it."""
    root = np.array([0.0, 95.0, 0.0]) + RNG.normal(size=(n_frames, 3))
    angles = {k: RNG.uniform(-60, 60, size=(n_frames, len(orders[k]))) for k in orders}
    channels = np.concatenate(
        [scale * root, *(angles[k] for k in range(len(TREE)) if k in orders)], axis=1
    )
    positions = np.zeros((n_frames, len(TREE), 3))
    turns = {}
    for k, (_, parent, offset) in enumerate(TREE):
        own = Rotation.identity(n_frames)
        if orders.get(k):
            own = Rotation.from_euler(orders[k], angles[k], degrees=True)
        turns[k] = own if parent < 0 else turns[parent] * own
        positions[:, k] = root if parent < 0 else positions[:, parent] + turns[parent].apply(offset)
    return channels, positions / 100, turns


def write_tree(path, orders, n_frames=5, scale=1.0, said=None, brace="\n"):
    channels, positions, turns = motion(orders, n_frames, scale)
    lines = [*tree_lines(orders, scale, brace), "MOTION", f"Frames: {said or n_frames}", "Frame Time: 0.0083333"]  # fmt: skip
    lines += [" ".join(f"{one:.9f}" for one in row) for row in channels]
    write_lines(lines, path)
    return lines, positions, turns


ORDERS = ["".join(order) for order in permutations("XYZ")]


@CONCLUDING
@pytest.mark.parametrize("order", [*ORDERS, "mixed"])
@pytest.mark.parametrize("brace", ["\n", " "])
def test_any_order_of_channels(tmp_path, order, brace):
    joints = [k for k, (name, _, _) in enumerate(TREE) if not name.endswith("_end")]
    orders = {k: order if order != "mixed" else ["ZXY", "X", "YZ", "XYZ", "ZYX", ""][at] for at, k in enumerate(joints)}  # fmt: skip
    _, positions, turns = write_tree(tmp_path / "a.bvh", orders, brace=brace)
    found = read_bvh(tmp_path / "a.bvh")
    assert found.names == tuple(name for name, _, _ in TREE)
    assert (found.rate_hz, found.origin.units) == (120.0, "cm")
    np.testing.assert_allclose(found.positions, positions, atol=1e-8)
    for k in range(len(TREE)):
        read = Rotation.from_quat(found.orientations[:, k], scalar_first=True)
        np.testing.assert_allclose((read.inv() * turns[k]).magnitude(), 0, atol=1e-7)


JOINTS = {k: "ZXY" for k, (name, _, _) in enumerate(TREE) if not name.endswith("_end")}


@pytest.mark.parametrize(
    ("name", "scale"), [("cm", 1), ("m", 0.01), ("mm", 10), ("in", 1 / 2.54), ("ft", 1 / 30.48), ("1/0.45 in", 0.45 / 2.54)]
)  # fmt: skip
def test_the_height_of_the_body_tells_the_units(tmp_path, name, scale):
    _, positions, _ = write_tree(tmp_path / "a.bvh", JOINTS, scale=scale)
    with pytest.warns(
        RecordingWarning, match=rf"no units are named; .* taken for {name}, by the size"
    ):
        found = read_bvh(tmp_path / "a.bvh")
    np.testing.assert_allclose(found.positions, positions, atol=1e-5)
    assert found.origin.units == name


def test_what_is_asked_for_and_what_no_person_is(tmp_path):
    _, positions, _ = write_tree(tmp_path / "a.bvh", JOINTS, scale=0.0001)
    with pytest.raises(
        RecordingError, match=r"the body is 0.0\d+ high, which is no person's in any"
    ):
        read_bvh(tmp_path / "a.bvh")
    found = read_bvh(tmp_path / "a.bvh", units="m")
    np.testing.assert_allclose(found.positions, positions / 100, atol=1e-6)


@CONCLUDING
@pytest.mark.parametrize("beside", [False, True])
def test_positions_of_every_joint(tmp_path, beside):
    """In place of the offsets, or near 0 beside them."""
    positions = np.array([[0.0, 0, 0], [0.2, 0, 0.8], [0.0, 0.1, 1.7]]) + np.zeros((4, 1, 1))
    written = Recording(np.arange(4) / 50, positions, ("a", "b", "c"), 50.0, "a")
    lines = bvh_lines(written, offsets=[(0, 0, 0), (0.2, 0.8, 0), (-0.2, 0.9, -0.1)])
    if beside:
        rows = np.array([line.split() for line in lines[-4:]], dtype=float)
        rows[:, 6:9] = rows[:, 12:15] = 0.0
        lines[-4:] = [" ".join(map(str, row)) for row in rows]
    found = read_bvh(write_lines(lines, tmp_path / "a.bvh"))
    turned = np.stack([positions[..., 0], positions[..., 2], -positions[..., 1]], axis=-1)
    np.testing.assert_allclose(found.positions, turned, atol=1e-8)


@CONCLUDING
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: lines[:12], "no line MOTION; is the file cut"),
        (lambda lines: [*lines[:3], "\tOFSET 0 0 0", *lines[4:]], r":4: got 'OFSET 0 0 0'; expected a joint"),
        (lambda lines: [*lines[:4], "\tCHANNELS 3 Xposition Yposition", *lines[5:]], "got 'CHANNELS 3 Xpos.*expected a joint"),
        (lambda lines: [*lines[:4], "\tCHANNELS 1e400 Xposition", *lines[5:]], "expected a joint"),
        (lambda lines: [*lines[:4], "\tCHANNELS 2 Xrotation Xrotation", *lines[5:]], "expected a joint"),
        (lambda lines: [line for line in lines if line != "}"], "got 'MOTION'; expected a joint"),
        (lambda lines: [line.replace("Frames:", "Frame") for line in lines], "expected 'Frames:' and a number"),
        (lambda lines: [line.replace("0.0083333", "0") for line in lines], "Frame Time is 0 s; expected 0.0001 to 1"),
        (lambda lines: [line.replace("0.0083333", "fast") for line in lines], "expected 'Frame Time:' and a number"),
        (lambda lines: [*lines[:3], "\tOFFSET 1e308 0 0", *lines[4:]], "got 'OFFSET 1e308 0 0'; expected a joint"),
        (lambda lines: [*lines[:-1], "-1e300 " + lines[-1].split(" ", 1)[1]], r"frame 5: channel 1 is -1e\+300; expected at most"),
        (lambda lines: lines[:-2], r"Frames is 5 and 3 follow; is the file cut\? --partial takes"),
        (lambda lines: [*lines[:-2], lines[-2] + " 7", lines[-1]], "got 22 columns, expected 21"),
        (lambda lines: [*lines[:-2], lines[-2][:60], lines[-1]], "channel .* of 21 has no number"),
        (lambda lines: [line for line in lines[:-5] if "CHANNELS" not in line], "no joint has channels"),
        (lambda lines: [], "the file is empty; expected a BVH"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, change, message):
    lines, _, _ = write_tree(tmp_path / "a.bvh", JOINTS)
    path = write_lines(change(lines), tmp_path / "b.bvh")
    with pytest.raises(RecordingError, match=message) as caught:
        read_bvh(path)
    assert "\n" not in str(caught.value)


def test_channels_named_twice_for_a_joint_are_more_than_the_numbers(tmp_path):
    path = tmp_path / "a.bvh"
    write_tree(path, JOINTS)
    lines = path.read_text().splitlines()
    at = max(k for k, line in enumerate(lines) if "CHANNELS" in line)
    words = lines[at].split()
    path.write_text("\n".join([*lines[:at], lines[at], f"CHANNELS 1 {words[2]}", *lines[at + 1 :]]))
    with pytest.raises(RecordingError, match=r"a\.bvh.*(got|expected)"):
        read_bvh(path)


def test_fewer_frames_than_the_file_says(tmp_path):
    write_tree(tmp_path / "a.bvh", JOINTS, said=9)
    with pytest.warns(RecordingWarning, match="Frames is 9 and 5 follow"):
        assert len(read_bvh(tmp_path / "a.bvh", partial=True).time) == 5


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("MOTION", "MOTION\n").replace("Frame Time", "\nFrame Time"),
        lambda text: text.replace("0.0083333", "0.0083333\n \n"),
        lambda text: text.replace(".", ","),
        lambda text: text.replace("\n", "\r"),
    ],
)
def test_blank_lines_decimal_commas_and_old_macs(tmp_path, change):
    lines, _, _ = write_tree(tmp_path / "a.bvh", JOINTS)
    plain = read_bvh(tmp_path / "a.bvh")
    (tmp_path / "b.bvh").write_bytes(change("\n".join(lines) + "\n").encode())
    found = read_bvh(tmp_path / "b.bvh")
    np.testing.assert_array_equal(found.positions, plain.positions)
    assert (found.names, found.rate_hz) == (plain.names, plain.rate_hz)


def test_a_rate_that_is_asked_for_stands_for_a_time_that_is_none(tmp_path):
    lines, _, _ = write_tree(tmp_path / "a.bvh", JOINTS)
    path = write_lines([line.replace("0.0083333", "0") for line in lines], tmp_path / "b.bvh")
    with reading(rate_hz=25.0), pytest.warns(RecordingWarning, match="no units are named"):
        assert read_bvh(path).rate_hz == 25.0


@CONCLUDING
def test_a_pose_before_the_movement_is_called_so(tmp_path):
    """As of CMU's database: the arms held out in the first frame, at rest from the next one on."""
    path = tmp_path / "a.bvh"
    lines, _, _ = write_tree(path, JOINTS, n_frames=9)
    head = lines[:-9]
    first, rest = np.zeros((2, 3 + 3 * len(JOINTS)))
    first[1] = rest[1] = 95.0
    rest[3 * (1 + list(JOINTS).index(4))] = -170.0
    rows = [" ".join(f"{one:.3f}" for one in row) for row in (first, *[rest] * 8)]
    write_lines([*head, *rows], path)
    with pytest.warns(
        RecordingWarning, match=r"of a pose before the movement became .*'LeftArm_end' fr"
    ):
        found = read_recording(path)
    assert np.flatnonzero(
        np.isnan(found.positions[:, found.names.index("LeftArm_end"), 0])
    ).tolist() == [0]
    write_lines([*head, *rows[1:], rows[0]], path)
    with pytest.warns(RecordingWarning, match=r"that no body makes became a gap: 'LeftArm_end' fr"):
        read_recording(path)
