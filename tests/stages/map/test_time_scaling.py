from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from besman.exceptions import MappingError
from besman.robot.dynamics import inverse_dynamics
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import load_robot
from besman.stages.map import path_change
from besman.stages.map.joint_spline import fit_spline
from besman.stages.map.needed_stretch import ChangeTolerance, needed_stretch, torque_stretch
from besman.stages.map.time_scaling import scale_path

ROBOTS = {name: load_robot(name) for name in ("ur5", "iiwa7", "compi")}
UR5 = ROBOTS["ur5"]
PLAIN = ChangeTolerance(position=0.0)
KINDS = ("waves", "noise", "step", "spike", "constant", "beyond", "at_limit", "rush")


def draw(robot, kind, seed, n_samples, size):
    """A path in joint space, well-behaved or not."""
    rng = np.random.default_rng(seed)
    limits, u = robot.limits, np.linspace(0, 1, n_samples)[:, None]
    low, high = limits.position_min, limits.position_max
    path = robot.home + 0 * u
    if kind == "waves":
        path = path + size * np.sin(rng.uniform(0, 9, robot.n) * u + rng.uniform(0, 6, robot.n))
    elif kind == "noise":
        path = path + rng.normal(0, size, path.shape)
    elif kind == "step":
        path = path + np.where(u > rng.uniform(), size * rng.choice([-1, 1], robot.n), 0.0)
    elif kind == "spike":
        path[rng.integers(n_samples)] += size * rng.choice([-1, 1], robot.n)
    elif kind == "beyond":
        path = path + rng.choice([-1, 1], robot.n) * 4 * size * u * (high - low)
    elif kind == "at_limit":
        path = np.where(rng.uniform(size=path.shape) < 0.5, low, high)
    elif kind == "rush":
        path = low + (high - low) * np.where(np.arange(n_samples) % 2, 1.0, 0.0)[:, None]
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 10_000),
    n_samples=st.integers(3, 60),
    rate=st.sampled_from([50.0, 100.0, 500.0]),
    size=st.floats(0.0, 1.5),
    free_spin=st.booleans(),
)
@example(kind="noise", seed=0, n_samples=60, rate=10.0, size=0.1, free_spin=False)
@example(kind="waves", seed=0, n_samples=400, rate=100.0, size=1.0, free_spin=True)
@example(kind="noise", seed=0, n_samples=1500, rate=100.0, size=0.01, free_spin=False)
@settings(max_examples=8, deadline=None)
def test_limits_hold_at_1_khz_whatever_comes_in(name, kind, seed, n_samples, rate, size, free_spin):
    robot = ROBOTS[name]
    path = draw(robot, kind, seed, n_samples, size)
    time = np.arange(n_samples) / rate
    scaled = scale_path(robot, time, path, tolerance=ChangeTolerance(free_spin=free_spin))
    dense_time, *dense = resample_trajectory(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    report = check_limits(robot, *dense)
    assert report.torque == 0 or weighs_too_much(robot, scaled.positions)
    assert report.violations == report.torque
    assert scaled.stretch >= 1.0
    assert dense_time[-1] == pytest.approx(time[-1] * scaled.stretch)
    plain = fit_spline(time, path, 0.05)
    if plain.inside(robot.limits):
        assert scaled.stretch <= max(1.0, needed_stretch(robot, plain)) * (1 + 1e-9)


def weighs_too_much(robot, positions):
    still = np.zeros_like(positions)
    static = np.abs(inverse_dynamics(robot, positions, still, still))
    return bool(np.any(static > 0.99 * robot.limits.torque))


def swing(robot, speed):
    """A smooth movement near home that breaks the limits at some speed."""
    time = np.linspace(0, 0.6, 61)
    return time, robot.home + 0.4 * np.sin(speed * time[:, None] + np.arange(robot.n))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_small_change_saves_time(name):
    robot = ROBOTS[name]
    time, path = swing(robot, 12.0)
    plain = scale_path(robot, time, path, tolerance=PLAIN)
    tolerance = ChangeTolerance(position=0.01, orientation=np.radians(8.0))
    changed = scale_path(robot, time, path, tolerance=tolerance)
    assert 1.0 < changed.stretch < 0.95 * plain.stretch
    change = path_change.PathChange(robot, path, tolerance)
    assert 0.2 < change.size(changed.positions) <= 1.0 + 1e-9
    assert change.size(plain.positions) < 0.1
    wider = replace(tolerance, position=0.02, orientation=np.radians(16.0))
    assert scale_path(robot, time, path, tolerance=wider).stretch < changed.stretch


def test_a_slow_movement_is_not_changed(monkeypatch):
    monkeypatch.setattr(path_change, "solve_change", None)
    time, path = swing(UR5, 0.5)
    scaled = scale_path(UR5, time, path)
    assert scaled.stretch == 1.0
    np.testing.assert_array_equal(scaled.positions, fit_spline(time, path, 0.05).samples()[0])
    stretched = scale_path(UR5, time, path, least_duration_s=0.9)
    assert stretched.stretch == pytest.approx(1.5)
    np.testing.assert_allclose(stretched.velocities * 1.5, scaled.velocities)


def test_a_least_duration_leaves_nothing_to_shorten():
    time, path = swing(UR5, 10.0)
    scaled = scale_path(UR5, time, path, least_duration_s=6.0)
    assert scaled.stretch == pytest.approx(10.0)
    np.testing.assert_array_equal(scaled.positions, fit_spline(time, path, 0.05).samples()[0])


def test_time_may_start_anywhere():
    time, path = swing(UR5, 12.0)
    one, other = scale_path(UR5, time, path), scale_path(UR5, time + 5.0, path)
    assert other.stretch == pytest.approx(one.stretch, rel=1e-6)
    np.testing.assert_allclose(other.positions, one.positions, atol=1e-6)


def test_a_path_that_overshoots_a_position_limit_is_bent_back():
    robot = ROBOTS["compi"]
    time = np.linspace(0, 0.5, 51)
    edge = robot.limits.position_max[0] - np.radians(0.5)
    path = np.tile(robot.home, (51, 1))
    path[:, 0] = np.minimum(edge, edge - 0.6 + 3.0 * time)
    spline = fit_spline(time, path, 0.05)
    over = replace(robot, limits=replace(robot.limits, position_max=path.max(axis=0) + 1e-4))
    assert spline.samples()[0][:, 0].max() > over.limits.position_max[0]
    scaled = scale_path(over, time, path, tolerance=PLAIN)
    assert np.all(scaled.positions <= over.limits.position_max)
    # Nothing but the overshoot is taken away.
    assert np.abs(scaled.positions - path).max() < 0.03


def test_without_a_solution_the_path_is_clipped_and_stretched(monkeypatch):
    def fail(*_):
        raise MappingError("no")

    monkeypatch.setattr(path_change, "solve_change", fail)
    robot = ROBOTS["iiwa7"]
    time = np.arange(60) / 100
    path = draw(robot, "beyond", 1, 60, 1.0)
    scaled = scale_path(robot, time, path)
    dense = resample_trajectory(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    assert check_limits(robot, *dense[1:]).violations == 0


def test_a_change_into_a_collision_is_not_taken(monkeypatch):
    time, path = swing(UR5, 12.0)
    plain = scale_path(UR5, time, path, tolerance=PLAIN)
    assert scale_path(UR5, time, path).stretch < plain.stretch
    distances = iter([-0.1, 0.1])
    monkeypatch.setattr("besman.stages.map.time_scaling.distances", lambda *_: next(distances))
    assert scale_path(UR5, time, path).stretch == plain.stretch


def weak(robot, share):
    return replace(robot, limits=replace(robot.limits, torque=share * robot.limits.torque))


def test_torques_stretch_time_exactly():
    time, path = swing(UR5, 6.0)
    spline = fit_spline(time, path, 0.05)
    movement = spline.at(spline.times(1000.0))
    still = np.zeros_like(movement[0])
    gravity = inverse_dynamics(UR5, movement[0], still, still)
    robot = weak(UR5, 1.1 * np.max(np.abs(gravity) / UR5.limits.torque))
    stretch = torque_stretch(robot, *movement)
    positions, velocities, accelerations = movement
    torques = inverse_dynamics(UR5, positions, velocities / stretch, accelerations / stretch**2)
    assert stretch > 1.0
    assert np.max(np.abs(torques) / robot.limits.torque) == pytest.approx(1.0)
    scaled = scale_path(robot, time, path)
    dense = resample_trajectory(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    report = check_limits(robot, *dense[1:])
    assert report.violations == 0
    assert report.torque_ratio > 0.9


def test_no_time_is_looked_for_where_none_helps():
    # Stretched out, and upright.
    positions = np.array([[0.0, 0, 0, 0, 0, 0], [0.0, -np.pi / 2, 0, 0, 0, 0]])
    still, moving = np.zeros((2, 6)), np.array([np.zeros(6), np.ones(6)])
    gravity = inverse_dynamics(UR5, positions, still, still)
    robot = weak(UR5, 0.9 * np.max(np.abs(gravity) / UR5.limits.torque))
    assert torque_stretch(robot, positions, still, moving) == 0.0
    # Where it lets itself fall it needs no torque, and the rest says how fast it may be.
    columns = [inverse_dynamics(UR5, positions[0], still[0], one) - gravity[0] for one in np.eye(6)]
    falling = moving.copy()
    falling[0] = np.linalg.solve(np.array(columns).T, -gravity[0])
    assert torque_stretch(robot, positions, still, falling) > 0.0


def test_an_arm_too_weak_for_its_own_weight():
    time, path = swing(UR5, 6.0)
    scaled = scale_path(weak(UR5, 0.01), time, path)
    dense = resample_trajectory(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    report = check_limits(weak(UR5, 0.01), *dense[1:])
    assert report.torque > 0
    assert report.violations == report.torque
    assert report.torque_ratio > 1.0
