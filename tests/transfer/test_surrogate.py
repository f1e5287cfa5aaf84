import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from besman.transfer.surrogate import GaussianShift, InverseDistance, weigh_by_distance

RANDOM = np.random.default_rng(0)
KNOWN, SHIFTS = RANDOM.normal(0, 4, (6, 6)), RANDOM.normal(0, 0.2, (6, 2))
NEW = RANDOM.normal(0, 4, (5, 6))


def kernel(a, b):
    squared = ((a[:, None] - b[None]) ** 2).sum(axis=2)
    return 0.4**2 + 0.15**2 * np.exp(-squared / (2 * 3.0**2))


def test_the_process_is_that_of_its_kernel():
    shifts, open_m = GaussianShift(KNOWN, SHIFTS).expect(NEW)
    inverse = np.linalg.inv(kernel(KNOWN, KNOWN) + 0.02**2 * np.eye(6))
    across = kernel(NEW, KNOWN)
    np.testing.assert_allclose(shifts, across @ inverse @ SHIFTS, atol=1e-9)
    variance = kernel(NEW, NEW).diagonal() - np.einsum("ij,jk,ik->i", across, inverse, across)
    np.testing.assert_allclose(open_m, np.sqrt(2 * variance), atol=1e-7)


def test_the_process_interpolates_within_repeatability():
    shifts, open_m = GaussianShift(KNOWN, SHIFTS).expect(KNOWN)
    assert np.abs(shifts - SHIFTS).max() < 0.03
    assert open_m.max() < 0.03


def test_what_nobody_tried_is_what_the_simulation_says():
    shifts, open_m = GaussianShift(np.empty((0, 6)), np.empty((0, 2))).expect(NEW)
    np.testing.assert_array_equal(shifts, 0)
    assert open_m == pytest.approx(np.sqrt(2) * np.hypot(0.4, 0.15))


def test_one_try_tells_of_all_what_they_share():
    near, far = KNOWN[:1] + 0.01, KNOWN[:1] + 100.0
    shifts, open_m = GaussianShift(KNOWN[:1], SHIFTS[:1]).expect(np.concatenate([near, far]))
    np.testing.assert_allclose(shifts[0], SHIFTS[0], atol=2e-3)
    np.testing.assert_allclose(shifts[1], SHIFTS[0], rtol=0.15)
    assert open_m[0] < 0.05 < open_m[1] < 0.35


def test_inverse_distance_is_exact_where_it_was_tried():
    shifts, disparities = InverseDistance(KNOWN, SHIFTS).expect(KNOWN)
    np.testing.assert_array_equal(shifts, 0)
    np.testing.assert_allclose(disparities, np.linalg.norm(SHIFTS, axis=1), rtol=1e-6)
    _, none = InverseDistance(np.empty((0, 6)), np.empty((0, 2))).expect(KNOWN)
    np.testing.assert_array_equal(none, 0)


@given(arrays(float, (4, 2), elements=st.floats(-5, 5)), arrays(float, 4, elements=st.floats(0, 1)))
def test_weights_are_those_of_the_formula(known, values):
    place = np.array([[10.0, 3.0]])
    weights = [1 / ((place[0] - one) ** 2).sum() for one in known]
    expected = sum(w * v for w, v in zip(weights, values, strict=True)) / sum(weights)
    (found,) = weigh_by_distance(known, values, place)
    assert found == pytest.approx(expected)
    assert values.min() - 1e-9 <= found <= values.max() + 1e-9
