import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from besman.geometry.quaternions import from_rotation_vector, multiply
from besman.motion.cartesian_dmp import (
    fit_poses,
    move_ends,
    pose_coordinates,
    roll_out_poses,
    same_turn,
)
from besman.motion.forcing import ALPHA, BETA, LAST_PHASE, forcing_basis


def random_dmp(seed=0, n_weights=10, scale=200.0):
    random = np.random.default_rng(seed)
    start, goal = random.normal(size=(2, 7))
    for pose in (start, goal):
        pose[3:] /= np.linalg.norm(pose[3:])
    return scale * random.normal(size=(6, n_weights)), start, same_turn(goal, start)


def angles(first, second):
    one, other = (Rotation.from_quat(q, scalar_first=True) for q in (first, second))
    return (one * other.inv()).magnitude()


def demonstration(seed=0, turn=2.0):
    """Turn by `turn` rad, and about other axes on the way."""
    random = np.random.default_rng(seed)
    x = np.linspace(0, 1, 90)
    blend = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    wave = np.sin(np.pi * x)[:, None] ** 3
    axis = random.normal(size=3)
    vectors = blend * turn * axis / np.linalg.norm(axis)
    first = from_rotation_vector(random.normal(size=3))
    turned = multiply(from_rotation_vector(0.4 * wave * random.normal(size=3)), first)
    orientations = multiply(from_rotation_vector(vectors), turned)
    positions = blend * random.normal(size=3) + 0.1 * wave * random.normal(size=3)
    return 0.8 * x, np.hstack([positions, orientations])


def test_position_and_rotation_vector_solve_the_differential_equation():
    """Of the rotation: integrate the tool's angular velocity, found by finite differences."""
    weights, start, goal = random_dmp()
    first = pose_coordinates(start, goal)
    last = np.concatenate([goal[:3], np.zeros(3)])

    def derivative(x, state):
        y, dy = state[:6], state[6:]
        phase = np.exp(np.log(LAST_PHASE) * x)
        force = weights @ forcing_basis(x, weights.shape[1])
        pull = ALPHA * (BETA * (last - y) - dy) - ALPHA * BETA * (last - first) * phase
        return np.concatenate([dy, pull + force])

    time = np.linspace(0, 0.7, 71)
    state = np.concatenate([first, np.zeros(6)])
    solution = solve_ivp(derivative, (0, 1), state, t_eval=time / 0.7, rtol=1e-11, atol=1e-12)
    poses = roll_out_poses(weights, start, goal, 0.7, time)
    np.testing.assert_allclose(poses[:, :3], solution.y[:3].T, atol=1e-9)
    turned = Rotation.from_rotvec(solution.y[3:6].T) * Rotation.from_quat(
        goal[3:], scalar_first=True
    )
    assert angles(poses[:, 3:], turned.as_quat(scalar_first=True)).max() < 1e-8
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1, atol=1e-12)


def quaternion_spring(weights, start, goal, time):
    """Integrate eq. 16 of Ude 2014 with the forcing term of Pastor 2009, as it stands."""
    g = Rotation.from_quat(goal, scalar_first=True)
    way = (g * Rotation.from_quat(start, scalar_first=True).inv()).as_rotvec()

    def derivative(x, state):
        q, w = state[:4] / np.linalg.norm(state[:4]), state[4:]
        left = (g * Rotation.from_quat(q, scalar_first=True).inv()).as_rotvec()
        phase = np.exp(np.log(LAST_PHASE) * x)
        force = weights @ forcing_basis(x, weights.shape[1])
        pull = ALPHA * (BETA * left - w) - ALPHA * BETA * way * phase
        return np.concatenate([0.5 * multiply(np.r_[0.0, w], q), pull + force])

    state = np.concatenate([start, np.zeros(3)])
    solution = solve_ivp(derivative, (0, 1), state, t_eval=time / time[-1], rtol=1e-10, atol=1e-11)
    return solution.y[:4].T / np.linalg.norm(solution.y[:4].T, axis=1, keepdims=True)


@pytest.mark.parametrize("turn", [0.0, 0.3, -2.9])
def test_is_the_spring_of_ude_where_the_tool_turns_about_one_axis(turn):
    axis = np.array([0.48, -0.6, 0.64])
    weights = np.outer(axis, 100 * np.random.default_rng(1).normal(size=8))
    first = from_rotation_vector([0.2, 0.3, 1.0])
    last = multiply(from_rotation_vector(turn * axis), first)
    start, goal = np.r_[0.0, 0, 0, first], np.r_[0.0, 0, 0, last]
    time = np.linspace(0, 0.9, 40)
    poses = roll_out_poses(np.vstack([np.zeros((3, 8)), weights]), start, goal, 0.9, time)
    assert angles(poses[:, 3:], quaternion_spring(weights, first, last, time)).max() < 1e-7


def test_is_near_the_spring_of_ude_where_the_turn_is_small():
    """The difference is of second order in the rotation."""
    weights, start, _ = random_dmp(3, scale=60.0)
    errors = []
    time = np.linspace(0, 0.7, 30)
    for scale in (0.4, 0.2, 0.1):
        last = multiply(from_rotation_vector(scale * np.array([0.5, -0.4, 0.3])), start[3:])
        goal = np.r_[start[:3], last]
        got = roll_out_poses(scale * weights, start, goal, 0.7, time)[:, 3:]
        errors.append(angles(got, quaternion_spring(scale * weights[3:], start[3:], last, time)))
    errors = [error.max() for error in errors]
    assert errors[0] < 0.03
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5


def test_agrees_with_movement_primitives_as_its_step_shrinks():
    dmp = pytest.importorskip("movement_primitives.dmp")
    axis = np.array([0.48, -0.6, 0.64])
    weights, start, goal = random_dmp()
    weights[3:] = np.outer(axis, 0.3 * weights[3])
    goal[3:] = multiply(from_rotation_vector(1.3 * axis), start[3:])
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        other = dmp.CartesianDMP(0.7, step, 10, int_dt=step, smooth_scaling=True)
        other.set_weights(weights.ravel())
        other.configure(start_y=start, goal_y=goal)
        time, expected = other.open_loop(step_function="euler")
        got = roll_out_poses(weights, start, goal, 0.7, time)
        errors.append(
            (np.abs(got - expected)[:, :3].max(), angles(got[:, 3:], expected[:, 3:]).max())
        )
    # Euler's error is of first order, in position and in orientation.
    np.testing.assert_allclose(np.divide(errors[0], errors[1]), 2, rtol=0.1)
    np.testing.assert_allclose(np.divide(errors[1], errors[2]), 2, rtol=0.1)


def test_imitates_no_worse_than_movement_primitives():
    dmp = pytest.importorskip("movement_primitives.dmp")
    time, poses = demonstration()
    weights, start, goal = fit_poses(time, poses, 20)
    ours = roll_out_poses(weights, start, goal, 0.8, time)
    other = dmp.CartesianDMP(0.8, time[1], 20, int_dt=time[1] / 10, smooth_scaling=True)
    other.imitate(time, poses)
    theirs = other.open_loop()[1][: len(time)]
    for error in (
        lambda got: np.abs(got[:, :3] - poses[:, :3]).max(),
        lambda got: angles(got[:, 3:], poses[:, 3:]).max(),
    ):
        assert error(ours) < error(theirs)


@given(st.integers(0, 1000), st.floats(0.0, 5.5))
@settings(max_examples=25, deadline=None)
def test_fit_imitates_and_rests_at_both_ends(seed, turn):
    time, poses = demonstration(seed, turn)
    # Signs of the quaternions carry nothing in a demonstration.
    signs = np.where(np.random.default_rng(seed).random(len(time)) < 0.5, -1.0, 1.0)
    flipped = np.hstack([poses[:, :3], poses[:, 3:] * signs[:, None]])
    weights, start, goal = fit_poses(time, flipped, 30)
    got = roll_out_poses(weights, start, goal, 0.8, time)
    assert np.abs(got - poses)[:, :3].max() < 2e-3
    assert angles(got[:, 3:], poses[:, 3:]).max() < 5e-3
    np.testing.assert_allclose(got[[0, -1], :3], poses[[0, -1], :3], atol=1e-9)
    assert angles(got[[0, -1], 3:], poses[[0, -1], 3:]).max() < 1e-7
    ends = roll_out_poses(weights, start, goal, 0.8, [0, 1e-4, 0.8 - 1e-4, 0.8])
    assert np.abs(ends[[0, 2], :3] - ends[[1, 3], :3]).max() < 1e-7
    assert angles(ends[[0, 2], 3:], ends[[1, 3], 3:]).max() < 1e-6


@given(st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_other_ends_are_reached_at_rest(seed):
    time, poses = demonstration(seed)
    weights, start, goal = fit_poses(time, poses, 12)
    _, first, last = random_dmp(seed)
    last = same_turn(last, goal)
    moved = move_ends(weights, (start, goal), (first, last))
    times = [0, 1e-4, 0.8 - 1e-4, 0.8]
    got = roll_out_poses(moved, first, last, 0.8, times)
    np.testing.assert_allclose(got[[0, -1], :3], [first[:3], last[:3]], atol=1e-9)
    assert angles(got[[0, -1], 3:], np.stack([first[3:], last[3:]])).max() < 1e-7
    assert np.abs(got[[0, 2], :3] - got[[1, 3], :3]).max() < 1e-6
    assert angles(got[[0, 2], 3:], got[[1, 3], 3:]).max() < 1e-5


def test_batch_is_the_same_as_one_by_one():
    dmps = [random_dmp(seed) for seed in range(4)]
    durations, time = np.linspace(0.4, 0.9, 4), np.arange(0, 1, 0.01)
    batch = roll_out_poses(*(np.stack(part) for part in zip(*dmps, strict=True)), durations, time)
    for index, dmp in enumerate(dmps):
        np.testing.assert_allclose(
            batch[index], roll_out_poses(*dmp, durations[index], time), atol=1e-9
        )
