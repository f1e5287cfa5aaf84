"""The compiled fit of a capsule, held against smallest circles found over all pairs and triples."""

import itertools

import numpy as np
import pytest

from besman.robot.capsule_kernel import fit_along
from besman.robot.capsules import distances_to_axis


def smallest_circle(points):
    """Return the radius of the smallest circle around points (V, 2), by trying all."""
    candidates = [
        ((a + b) / 2, np.linalg.norm(a - b) / 2) for a, b in itertools.combinations(points, 2)
    ]
    for a, b, c in itertools.combinations(points, 3):
        matrix = 2 * np.array([b - a, c - a])
        if abs(np.linalg.det(matrix)) > 1e-12:
            middle = np.linalg.solve(matrix, [b @ b - a @ a, c @ c - a @ a])
            candidates.append((middle, np.linalg.norm(a - middle)))
    return min(
        radius
        for middle, radius in candidates
        if np.all(np.linalg.norm(points - middle, axis=1) <= radius + 1e-9)
    )


def volume(ends, radius):
    return np.pi * radius**2 * (np.linalg.norm(ends[1] - ends[0]) + 4 / 3 * radius)


@pytest.mark.parametrize("seed", range(5))
def test_a_capsule_along_an_axis_is_as_narrow_as_the_smallest_circle_permits(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3)) * [0.05, 0.03, 0.3]
    ends = np.zeros((2, 3))
    radius = fit_along(points, np.array([[0.0, 0.0, 1.0]]), ends)
    assert np.max(distances_to_axis(points, ends)) <= radius + 1e-9
    exact = smallest_circle(points[:, :2])
    assert exact - 1e-9 <= radius <= 1.2 * 1.01 * exact
    # No more room than that circle's capsule takes from the first point to the last.
    whole = np.array([[0.0, 0.0, points[:, 2].min()], [0.0, 0.0, points[:, 2].max()]])
    assert volume(ends, radius) <= 1.02 * volume(whole, exact)


def test_the_best_of_several_axes_is_taken():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(40, 3)) * [0.3, 0.03, 0.03]
    both, one = np.zeros((2, 3)), np.zeros((2, 3))
    radius = fit_along(points, np.eye(3), both)
    narrow = fit_along(points, np.eye(3)[:1], one)
    assert radius == narrow
    np.testing.assert_array_equal(both, one)
    wide = fit_along(points, np.eye(3)[1:], one)
    assert volume(both, radius) < volume(one, wide)
