import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.exceptions import LabellingError
from besman.geometry.frames import (
    back_frame,
    hand_frame,
    quaternion_to_rotation,
    rotation_to_quaternion,
)

BACK = np.array([[0.0, 0.0, 1.4], [0.02, 0.1, 1.2], [0.02, -0.1, 1.2]])
HAND = np.array([[0.05, 0.0, 0.0], [-0.02, 0.03, 0.0], [-0.02, -0.03, 0.0]])


def test_back_frame_of_a_person_who_looks_along_x_is_the_laboratory():
    rotation, origin = back_frame(*BACK)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(origin, BACK.mean(axis=0))


@given(st.floats(-np.pi, np.pi), st.floats(-0.5, 0.5))
def test_back_frame_follows_the_heading_and_ignores_the_lean(heading, lean):
    turn = Rotation.from_euler("ZY", [heading, lean]).as_matrix()
    rotation, _ = back_frame(*(BACK @ turn.T))
    np.testing.assert_allclose(rotation, Rotation.from_euler("z", heading).as_matrix(), atol=1e-12)


def test_hand_frame_of_a_flat_right_hand_has_the_back_of_the_hand_up():
    rotation, origin = hand_frame(*HAND)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(origin, HAND.mean(axis=0))


def test_hand_frame_turns_with_the_hand_over_any_leading_dimensions():
    turns = Rotation.random(12, rng=np.random.default_rng(1)).as_matrix().reshape(3, 4, 3, 3)
    markers = np.einsum("...ij,mj->m...i", turns, HAND)
    rotation, _ = hand_frame(*markers)
    np.testing.assert_allclose(rotation, turns, atol=1e-12)


def test_quaternions_round_trip_and_do_not_jump():
    angles = np.linspace(0, 4 * np.pi, 200)
    matrices = Rotation.from_rotvec(angles[:, np.newaxis] * [0.6, 0.0, 0.8]).as_matrix()
    quaternions = rotation_to_quaternion(matrices)
    assert quaternions[0, 0] == 1.0
    assert np.abs(np.diff(quaternions, axis=0)).max() < 0.1
    np.testing.assert_allclose(quaternion_to_rotation(quaternions), matrices, atol=1e-12)
    np.testing.assert_allclose(rotation_to_quaternion(np.eye(3)), [1, 0, 0, 0])


@pytest.mark.parametrize("shape", [(4,), (5, 4), (2, 3, 4)])
def test_matrices_of_quaternions_beside_scipy(shape):
    quaternions = 3.0 * np.random.default_rng(6).normal(size=shape)
    expected = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    found = quaternion_to_rotation(quaternions)
    np.testing.assert_allclose(found, expected.reshape(*shape[:-1], 3, 3), rtol=0, atol=1e-15)


def test_a_quaternion_without_length_or_not_seen_has_no_matrix():
    found = quaternion_to_rotation([[0, 0, 0, 0], [np.nan] * 4, [2, 0, 0, 0]])
    assert np.isnan(found[:2]).all()
    np.testing.assert_array_equal(found[2], np.eye(3))


def test_markers_on_top_of_each_other_are_refused():
    with pytest.raises(LabellingError, match="back frame: expected back_left and back_right at"):
        back_frame(BACK[0], BACK[1], BACK[1])


def test_markers_on_a_line_are_refused_with_the_sample():
    markers = np.repeat(HAND[:, np.newaxis], 5, axis=1)
    markers[:, 3] = [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]
    with pytest.raises(LabellingError, match="hand frame at sample 3: expected three hand markers"):
        hand_frame(*markers)


def test_an_unseen_marker_is_refused():
    markers = np.repeat(BACK[:, np.newaxis], 5, axis=1)
    markers[1, 2] = np.nan
    with pytest.raises(LabellingError, match="back frame at sample 2"):
        back_frame(*markers)


def test_markers_of_different_shape_are_refused():
    with pytest.raises(LabellingError, match=r"hand frame: markers must have one shape"):
        hand_frame(HAND[0], HAND[1], HAND)
