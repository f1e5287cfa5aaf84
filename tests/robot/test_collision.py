import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from besman.robot.collision import distances
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.nearest_pair import segment_distance

ROBOT = load_robot("ur5", "stick_holder")
POINTS = arrays(np.float64, (4, 3), elements=st.floats(-2, 2).map(lambda x: round(x, 3)))


def brute_force(p0, p1, q0, q1):
    share = np.linspace(0, 1, 201)
    first = p0 + share[:, None] * (p1 - p0)
    second = q0 + share[:, None] * (q1 - q0)
    return np.linalg.norm(first[:, None] - second[None], axis=2).min()


@given(POINTS)
@settings(max_examples=150, deadline=None)
def test_segment_distance_agrees_with_brute_force(points):
    got = segment_distance(*points)
    expected = brute_force(*points)
    length = np.linalg.norm(points[1] - points[0]) + np.linalg.norm(points[3] - points[2])
    assert got <= expected + 1e-9
    assert got >= expected - length / 400 - 1e-9
    assert segment_distance(points[2], points[3], points[0], points[1]) == pytest.approx(got)


def test_points_and_parallel_segments():
    zero, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert segment_distance(zero, zero, x, x) == pytest.approx(1.0)
    assert segment_distance(zero, x, y, y) == pytest.approx(1.0)
    assert segment_distance(zero, zero, y - x, y + x) == pytest.approx(1.0)
    assert segment_distance(zero, x, y, x + y) == pytest.approx(1.0)
    assert segment_distance(zero, x, 3 * x, 5 * x) == pytest.approx(2.0)


def test_distances_agree_with_coal():
    coal = pytest.importorskip("coal")
    import pinocchio

    chain, data = ROBOT.chain, ROBOT.model.createData()
    for angles in np.random.default_rng(1).uniform(-2.5, 2.5, (20, 6)):
        pinocchio.forwardKinematics(ROBOT.model, data, angles)
        poses, shapes = [], []
        for joint, ends, radius in zip(
            chain.capsule_joints, chain.capsule_ends, chain.capsule_radii, strict=True
        ):
            place = data.oMi[int(joint) + 1] if joint >= 0 else pinocchio.SE3.Identity()
            start, end = place.act(ends[0]), place.act(ends[1])
            turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), end - start)
            length = float(np.linalg.norm(end - start))
            shapes.append(coal.Capsule(float(radius), length))
            poses.append(coal.Transform3s(turn.matrix(), (start + end) / 2))
        nearest = min(
            coal.distance(
                shapes[a], poses[a], shapes[b], poses[b], coal.DistanceRequest(),
                coal.DistanceResult(),
            )
            for a, b in chain.capsule_pairs
        )  # fmt: skip
        assert distances(chain, angles)[0] == pytest.approx(nearest, abs=1e-5)


def test_home_is_clear_and_a_folded_arm_is_not():
    assert distances(ROBOT.chain, ROBOT.home)[0] > 0.02
    folded = np.array([0.0, -1.5, 3.0, 0.0, 0.0, 0.0])
    assert distances(ROBOT.chain, folded)[0] < 0.0


def test_the_floor_is_met_when_the_arm_hangs_on_a_low_base():
    down = np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0])
    lowest = distances(ROBOT.chain, down)[1]
    assert lowest < forward_kinematics(ROBOT.chain, down)[2, 3]
    assert distances(ROBOT.chain, ROBOT.home)[1] > 1.0


def test_shapes():
    assert distances(ROBOT.chain, np.zeros((3, 4, 6))).shape == (3, 4, 2)


def test_distances_that_are_small_are_the_same_without_a_look_at_great_ones():
    robot = load_robot("ur5", "stick_holder")
    poses = np.random.default_rng(5).uniform(-np.pi, np.pi, (300, robot.n))
    everything = distances(robot.chain, poses)
    assert (everything[:, 0] < 0.03).any()
    assert (everything[:, 0] > 0.03).any()
    near = distances(robot.chain, poses, beyond=0.03)
    np.testing.assert_array_equal(near[:, 0], np.minimum(everything[:, 0], 0.03))
    np.testing.assert_array_equal(near[:, 1], everything[:, 1])
