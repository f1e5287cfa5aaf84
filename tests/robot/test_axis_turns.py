"""Turns about an axis against scipy's rotations, and against looking at all angles."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.robot.axis_turns import dot_product, rotate, turn_between, turn_to_height


@pytest.fixture
def vectors():
    """Return a unit axis and two vectors."""
    axis, first, second = np.random.default_rng(3).normal(size=(3, 3))
    return axis / np.linalg.norm(axis), first, second


def turned(axis, angle, vector):
    result = np.empty(3)
    rotate(axis, angle, vector, result)
    return result


def test_a_turn_is_that_of_the_rotation_vector(vectors):
    axis, vector, _ = vectors
    for angle in (-4.0, -0.3, 0.0, 1.2, np.pi):
        expected = Rotation.from_rotvec(angle * axis).apply(vector)
        np.testing.assert_allclose(turned(axis, angle, vector), expected, atol=1e-12)


def test_the_angle_between_vectors_is_the_one_that_turned_them(vectors):
    axis, vector, _ = vectors
    for angle in (-3.0, -0.3, 0.0, 1.2):
        found, size = turn_between(axis, vector, 2.0 * turned(axis, angle, vector) + 0.7 * axis)
        assert found == pytest.approx(angle)
        assert size == pytest.approx(np.linalg.norm(np.cross(axis, vector)))


def test_heights_are_met_as_often_as_a_look_at_all_angles_finds_them(vectors):
    axis, vector, along = vectors
    angles = np.linspace(-np.pi, np.pi, 20_001)
    heights = Rotation.from_rotvec(angles[:, None] * axis).apply(vector) @ along
    for height in np.linspace(heights.min() - 1.0, heights.max() + 1.0, 9):
        *found, state = turn_to_height(axis, vector, along, height)
        crossings = np.count_nonzero(np.diff(np.sign(heights - height)))
        assert state == (1 if crossings else 0)
        if state:
            for angle in found:
                assert dot_product(turned(axis, angle, vector), along) == pytest.approx(height)
            assert np.cos(found[0]) != pytest.approx(np.cos(found[1]))


def test_a_vector_along_the_axis_has_one_height_at_every_angle(vectors):
    axis, _, along = vectors
    height = dot_product(axis, along)
    assert turn_to_height(axis, axis, along, height)[2] == -1
    assert turn_to_height(axis, axis, along, height + 0.1)[2] == 0
