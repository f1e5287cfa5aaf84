import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from besman.exceptions import LabellingError
from besman.geometry.frames import back_frame, hand_frame
from besman.person.body_frames import BodyFrames
from besman.person.marker_set import load_marker_set
from besman.records import LabelledRecording, Recording
from besman.stages.label.derive_markers import derive_markers
from besman.stages.label.stage import LabelConfig

NAMES = ("base_link", "upper_arm_link", "forearm_link", "tool0")


def taught(turned=True, n=30):
    rng = np.random.default_rng(3)
    time = np.arange(n) / 50
    positions = rng.normal(size=(4, 3)) + np.zeros((n, 1, 3))
    positions[:, 3] += 0.1 * np.sin(3 * time)[:, None]
    base = Rotation.from_rotvec([0, 0, 0.7])
    hand = Rotation.from_rotvec(rng.normal(size=3) + 0.3 * np.sin(time)[:, None] * [1, 2, 3])
    orientations = np.zeros((n, 4, 4))
    orientations[..., 0] = 1.0
    orientations[:, 0] = base.as_quat(scalar_first=True)
    orientations[:, 3] = hand.as_quat(scalar_first=True)
    recording = Recording(time, positions, NAMES, 50.0, "a.mcap",
                          orientations=orientations if turned else None)  # fmt: skip
    return recording, base.as_matrix(), hand.as_matrix()


def test_frames_of_back_and_hand_are_those_of_base_and_tool():
    recording, base, hand = taught()
    labelled = LabelConfig().take_given(recording, load_marker_set("robot_arm"))
    rotation, origin = back_frame(
        *(labelled.marker(f"back_{one}") for one in ("top", "left", "right"))
    )
    np.testing.assert_allclose(rotation, np.broadcast_to(base, rotation.shape), atol=1e-9)
    np.testing.assert_allclose(origin, recording.positions[:, 0], atol=1e-9)
    rotation, origin = hand_frame(
        *(labelled.marker(f"hand_{one}") for one in ("top", "left", "right"))
    )
    np.testing.assert_allclose(origin, recording.positions[:, 3], atol=1e-9)
    for name, column in (("shoulder", 1), ("elbow", 2)):
        np.testing.assert_array_equal(labelled.marker(name), recording.positions[:, column])
    # The flange's z points as fingers do, its x out of the palm.
    np.testing.assert_allclose(rotation[..., 0], hand[..., 2], atol=1e-9)
    np.testing.assert_allclose(rotation[..., 2], -hand[..., 0], atol=1e-9)


def test_without_orientations():
    recording, _, _ = taught(turned=False)
    marker_set = load_marker_set("robot_arm")
    labelled = LabelledRecording(
        recording.time, recording.positions, ("arm_base", "arm_upper", "arm_fore", "arm_tool"),
        np.zeros((30, 4), bool), 50.0, "a.mcap",
    )  # fmt: skip
    with pytest.raises(LabellingError, match="nothing tells how arm_tool of robot_arm is turned"):
        derive_markers(labelled, marker_set)


def test_bodies_that_are_not_seen():
    frames = BodyFrames(base="a", shoulder="a", elbow="b", hand="b")
    positions = np.zeros((3, 2, 3))
    turned = np.zeros((3, 2, 4))
    turned[:, :, 0] = 1.0
    turned[1, 1] = np.nan
    found = frames.derive_of_bodies(positions, turned, ("a", "b"), np.zeros((3, 2), bool))
    assert found.names == frames.names
    hidden = np.isnan(found.positions).any(axis=2)
    assert hidden[1].tolist() == [False] * 3 + [True] * 3 + [False] * 2
    assert not hidden[[0, 2]].any()
    assert frames.find_assumptions(("a",)) == ()
    with pytest.raises(ValidationError):
        BodyFrames(base="a", shoulder="a", elbow="b", hand="b", hand_axes=((1, 0, 0),))
