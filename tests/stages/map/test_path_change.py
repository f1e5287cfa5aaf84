from dataclasses import replace

import numpy as np
import pytest

from besman.robot.dynamics import inverse_dynamics
from besman.robot.model import load_robot
from besman.stages.map.joint_spline import DEGREE, fit_spline
from besman.stages.map.needed_stretch import ChangeTolerance, needed_stretch, torque_stretch
from besman.stages.map.path_change import PathChange, shorten, smallest_change, torque_rows

ROBOT = load_robot("iiwa7", "stick_holder")
TIME = np.linspace(0, 0.5, 51)


def path(seed=0, speed=9.0):
    rng = np.random.default_rng(seed)
    return ROBOT.home + 0.4 * np.sin(speed * TIME[:, None] + rng.uniform(0, 6, ROBOT.n))


def full(metric):
    """The blocks as one symmetric matrix."""
    count, n = metric.gradient.shape
    matrix = np.zeros((count, n, count, n))
    for shift in range(len(metric.bands)):
        for row in range(count - shift):
            matrix[row, :, row + shift] = metric.bands[shift, row]
            matrix[row + shift, :, row] = metric.bands[shift, row].T
    return matrix.reshape(count * n, count * n)


@pytest.mark.parametrize("free_spin", [True, False])
def test_the_metric_is_the_mean_square_of_the_change(free_spin):
    tolerance = ChangeTolerance(free_spin=free_spin)
    change = PathChange(ROBOT, path(), tolerance)
    rng = np.random.default_rng(1)
    near = fit_spline(TIME, path() + 0.01 * np.sin(9 * TIME)[:, None], 0.05)
    metric = change.metric(near)

    def cost(points):
        positions = near.basis @ points
        errors = change.errors(positions) / [[tolerance.position], [tolerance.orientation]]
        joints = positions - path()
        return 0.5 * (np.sum(errors**2) + np.sum(joints**2)) / len(TIME)

    step = rng.normal(size=near.points.shape)
    slope = (cost(near.points + 1e-6 * step) - cost(near.points - 1e-6 * step)) / 2e-6
    assert np.sum(metric.gradient * step) == pytest.approx(slope, rel=0.02)
    # Where there is no change yet, Gauss-Newton's is the second derivative.
    at = fit_spline(TIME, path(), 0.02)
    at_change = PathChange(ROBOT, at.samples()[0], tolerance)
    metric, step = at_change.metric(at), rng.normal(size=at.points.shape)
    np.testing.assert_allclose(metric.gradient, 0.0, atol=1e-9)

    def size_of(points):
        positions = at.basis @ points
        errors = at_change.errors(positions) / [[tolerance.position], [tolerance.orientation]]
        return (np.sum(errors**2) + np.sum((positions - at.samples()[0]) ** 2)) / len(TIME)

    expected = size_of(at.points + 1e-5 * step) / 1e-10
    assert step.ravel() @ full(metric) @ step.ravel() == pytest.approx(expected, rel=1e-3)


def test_errors_of_a_turn_about_the_tools_axis():
    turned = path().copy()
    turned[:, -1] += 0.3
    spin = PathChange(load_robot("iiwa7", "gripper"), path(), ChangeTolerance(free_spin=True))
    whole = PathChange(load_robot("iiwa7", "gripper"), path(), ChangeTolerance())
    np.testing.assert_allclose(spin.errors(turned)[:, 1], 0.0, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(whole.errors(turned)[:, 1], axis=1), 0.3, atol=1e-9)
    assert whole.size(turned) == pytest.approx(0.3 / np.radians(5.0))
    assert spin.size(turned) < 1e-3


def test_the_smallest_change_keeps_the_limits_in_the_given_time():
    spline = fit_spline(TIME, path(), 0.05)
    change = PathChange(ROBOT, path(), ChangeTolerance(free_spin=True))
    stretch = 0.9 * needed_stretch(ROBOT, spline)
    sizes = []
    for rounds in (1, 3):
        changed, size = smallest_change(ROBOT, spline, change, stretch, rounds)
        sizes.append(size)
        speed = np.abs(changed.velocity_points()) / stretch
        pull = np.abs(changed.acceleration_points()) / stretch**2
        assert np.all(speed <= ROBOT.limits.velocity * (1 + 1e-6))
        assert np.all(pull <= ROBOT.limits.acceleration * (1 + 1e-6))
        assert changed.inside(ROBOT.limits)
        assert change.size(changed.basis @ changed.points) == size
    assert sizes[1] <= sizes[0]


def test_shorter_within_the_tolerance_and_no_shorter_than_asked():
    spline = fit_spline(TIME, path(), 0.05)
    plain = needed_stretch(ROBOT, spline)
    tolerance = ChangeTolerance(free_spin=True)
    change = PathChange(ROBOT, path(), tolerance)
    for least in (0.5, 0.95 * plain):
        found = shorten(ROBOT, spline, path(), tolerance, least)
        assert change.size(found.basis @ found.points) <= 1.0
        assert needed_stretch(ROBOT, found) < plain
        assert needed_stretch(ROBOT, found) > 0.9 * least
    again = shorten(ROBOT, spline, path(), tolerance, 0.5)
    once = shorten(ROBOT, spline, path(), tolerance, 0.5)
    assert again.points.tobytes() == once.points.tobytes()


def weak(spline, share):
    """The arm with so little torque that gravity takes a share of it."""
    still = np.zeros_like(spline.samples()[0])
    static = np.abs(inverse_dynamics(ROBOT, spline.samples()[0], still, still)).max(axis=0)
    torque = np.maximum(static / share, 1.0)
    return replace(ROBOT, limits=replace(ROBOT.limits, torque=torque))


def test_torques_are_linearised_as_finite_differences_say():
    spline, stretch = fit_spline(TIME, path(), 0.05), 1.3
    rows = torque_rows(ROBOT, spline, stretch)

    def shares(points):
        q, v, a = spline.moved(points).at(spline.centres)
        torques = inverse_dynamics(ROBOT, q, v / stretch, a / stretch**2)
        return torques / ROBOT.limits.torque

    np.testing.assert_allclose(rows.shares, shares(spline.points), atol=1e-9)
    step = np.random.default_rng(0).normal(size=spline.points.shape)
    expected = (shares(spline.points + 1e-6 * step) - shares(spline.points - 1e-6 * step)) / 2e-6
    padded = np.pad(step, ((DEGREE, DEGREE), (0, 0)))
    near = np.stack([padded[row : row + 2 * DEGREE + 1] for row in range(len(step))])
    np.testing.assert_allclose(
        np.einsum("kjdm,kdm->kj", rows.slopes, near), expected, atol=1e-6 * np.abs(expected).max()
    )


def test_the_smallest_change_keeps_torques_in_the_given_time():
    spline = fit_spline(TIME, path(speed=5.0), 0.05)
    robot = weak(spline, 0.8)
    change = PathChange(robot, path(speed=5.0), ChangeTolerance(free_spin=True))
    stretch = 0.9 * torque_stretch(robot, *spline.samples())
    assert stretch > 1.0
    changed, _ = smallest_change(robot, spline, change, stretch, 3, torques=True)
    ignored, _ = smallest_change(robot, spline, change, stretch, 3)
    assert torque_stretch(robot, *ignored.samples()) > 1.05 * stretch
    assert torque_stretch(robot, *changed.samples()) < 1.03 * stretch


def test_where_torque_is_short_a_change_of_path_saves_time_too():
    spline = fit_spline(TIME, path(speed=5.0), 0.05)
    robot = weak(spline, 0.8)
    tolerance = ChangeTolerance(free_spin=True)
    found = shorten(robot, spline, path(speed=5.0), tolerance, 1.0)
    assert needed_stretch(robot, found) < 0.97 * needed_stretch(robot, spline)
    assert PathChange(robot, path(speed=5.0), tolerance).size(found.samples()[0]) <= 1.0 + 1e-9
