import numpy as np
import pytest
from places import SAMPLE

from besman.geometry.frames import quaternion_to_rotation
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.person.mirror import find_side, mirror_name, mirror_recording
from besman.records import Recording
from besman.stages.label.methods import DefaultLabelConfig


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("left_elbow", "right_elbow"),
        ("Right hand top", "Left hand top"),
        ("hand_left", "hand_right"),
        ("RELB", "LELB"),
        ("LShoulder", "RShoulder"),
        ("r_shoulder_study", "l_shoulder_study"),
        ("r.ASIS", "l.ASIS"),
        ("elbow_r", "elbow_l"),
        ("ASISr", "ASISl"),
        ("LEFT WRIST", "RIGHT WRIST"),
        ("rShldr", "lShldr"),
        ("Bip01 R Hand", "Bip01 L Hand"),
        ("rhumerus", "lhumerus"),
    ],
)
def test_a_name_is_turned_to_the_other_side_and_back(name, other):
    assert mirror_name(name) == other
    assert mirror_name(other) == name


@pytest.mark.parametrize(
    "name", ["Shoulder", "lumbar", "ribs", "Elbow", "back_top", "stick_tip", "root", "lowerback"]
)
def test_a_name_without_a_side_stays(name):
    assert mirror_name(name) == name
    assert find_side(name) == ""


def test_sides_of_names():
    assert find_side("Ann:RELB") == "right"
    assert find_side("left_hand_right") == "left"
    assert find_side("Hand left") == ""  # the left one on the hand, of whichever hand


def test_a_mirror_turns_y_round_and_keeps_orientations_rotations():
    rng = np.random.default_rng(3)
    turned = rng.normal(size=(5, 2, 4))
    turned /= np.linalg.norm(turned, axis=2, keepdims=True)
    given = Recording(np.arange(5) / 50, rng.normal(size=(5, 2, 3)), ("a", None), 50.0, "a.c3d",
                      orientations=turned)  # fmt: skip
    mirrored = mirror_recording(given)
    plane = np.diag([1.0, -1.0, 1.0])
    np.testing.assert_array_equal(mirrored.positions, given.positions @ plane)
    expected = plane @ quaternion_to_rotation(given.orientations) @ plane
    np.testing.assert_allclose(quaternion_to_rotation(mirrored.orientations), expected, atol=1e-12)
    np.testing.assert_array_equal(mirror_recording(mirrored).positions, given.positions)


@pytest.mark.parametrize("written", [lambda name: name, lambda name: f"Ann:{name}"])
def test_a_left_handed_person_is_labelled_as_the_right_handed_one_in_the_mirror(written):
    plain = read_recording(SAMPLE / "subject1.tsv")
    mirrored = mirror_recording(plain)
    left = Recording(
        mirrored.time,
        mirrored.positions,
        tuple(name and written(mirror_name(name)) for name in plain.names),
        plain.rate_hz,
        plain.source,
        plain.first_frame,
    )
    right_arm = load_marker_set("right_arm")
    (expected,) = DefaultLabelConfig().run((plain,), right_arm)
    (got,) = DefaultLabelConfig().run((left,), right_arm.model_copy(update={"side": "left"}))
    assert got.markers == expected.markers
    np.testing.assert_array_equal(got.positions, expected.positions)
    np.testing.assert_array_equal(got.filled, expected.filled)
