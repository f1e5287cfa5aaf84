import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.synthetic.person import (
    JOINT_NAMES,
    ReachError,
    draw_person,
    move_arm,
    reach_with,
    see_from_torso,
    solve_arm,
)

LOW = np.array([-0.5, -0.9, -0.5, 0.4, 0.2, -0.5, -0.5])
HIGH = np.array([1.8, 0.0, 1.5, 2.4, 1.6, 0.5, 0.5])


@pytest.fixture
def person():
    return draw_person(np.random.default_rng(1))


@pytest.fixture
def joints():
    return np.random.default_rng(2).uniform(LOW, HIGH, (200, len(JOINT_NAMES)))


def same_angles(first: np.ndarray, second: np.ndarray) -> None:
    np.testing.assert_allclose(np.exp(1j * first), np.exp(1j * second), atol=1e-9)


def test_inverse_kinematics_undo_forward_kinematics(person, joints):
    arm = move_arm(person, joints)
    same_angles(solve_arm(person, arm.hand, arm.hand2torso, arm.elbow), joints)
    same_angles(reach_with(person, arm.hand, joints[:, 4:], arm.elbow), joints)


def test_limbs_keep_their_lengths(person, joints):
    arm = move_arm(person, joints)
    wrist = arm.hand - arm.hand2torso @ person.wrist_to_hand
    np.testing.assert_allclose(np.linalg.norm(arm.elbow, axis=1), person.upper_arm_m)
    np.testing.assert_allclose(np.linalg.norm(wrist - arm.elbow, axis=1), person.forearm_m)


def test_arm_at_zero_points_forward(person):
    arm = move_arm(person, np.zeros((1, 7)))
    np.testing.assert_allclose(arm.elbow, [[person.upper_arm_m, 0, 0]])
    np.testing.assert_allclose(arm.hand2torso, [np.eye(3)], atol=1e-12)
    assert arm.hand[0, 0] == pytest.approx(person.reach_m)


def test_out_of_reach(person):
    far = np.array([[1.0, 0, 0]])
    down = np.array([[0, 0, -1.0]])
    with pytest.raises(
        ReachError, match=r"the hand is 1.000 to 1.000 m from the shoulder, the arm"
    ):
        reach_with(person, far, np.zeros((1, 3)), down)
    with pytest.raises(ReachError, match=r"the wrist is .* m from the shoulder, the arm allows"):
        solve_arm(person, far, np.eye(3)[np.newaxis], down)


def test_a_turned_torso_sees_the_hand_elsewhere(person):
    hand = np.array([[0.3, -0.2, 0.1]])
    np.testing.assert_allclose(see_from_torso(person, hand, Rotation.identity()), hand)
    turned = Rotation.from_euler("ZY", [0.3, 0.2])
    seen = see_from_torso(person, hand, turned)
    hips2shoulder = person.shoulder - person.hips
    np.testing.assert_allclose(turned.apply(seen + hips2shoulder) - hips2shoulder, hand)


def test_people_differ_within_human_measures():
    people = [draw_person(np.random.default_rng(seed)) for seed in range(50)]
    heights = [person.height_m for person in people]
    assert min(heights) >= 1.58
    assert max(heights) <= 1.82
    assert np.std(heights) > 0.03
    assert all(0.25 < person.upper_arm_m < 0.36 for person in people)
