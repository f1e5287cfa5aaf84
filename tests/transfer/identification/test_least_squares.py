"""Linear problems, whose answer and covariance are known, and what data does not tell."""

import numpy as np
import pytest

from besman.transfer.identification.least_squares import estimate

RANDOM = np.random.default_rng(0)
N, NOISE = 4000, 0.1
TRUTH = np.array([1.0, -2.0, 0.5])
WIDE = (np.full(3, -100.0), np.full(3, 100.0))


def fit(slopes, truth=TRUTH, noise=NOISE, bounds=WIDE, resolution=0.0, units=1.0, jobs=1):
    slopes = np.asarray(slopes)
    measured = slopes @ truth + noise * np.random.default_rng(1).standard_normal(len(slopes))
    start = np.zeros(slopes.shape[1])
    return estimate(
        lambda values: [(slopes @ values - measured)[:, None]],
        start, np.full(len(start), units), bounds, resolution, jobs,
    )  # fmt: skip


def test_what_is_told_is_found_with_the_deviations_of_linear_regression():
    slopes = RANDOM.normal(size=(N, 3)) * [1.0, 2.0, 0.5]
    found = fit(slopes)
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert found.told.all()
    # The series' own correlation is looked for as well, and found where there is none.
    np.testing.assert_allclose(found.deviations, expected, rtol=0.15)
    assert (np.abs(found.values - TRUTH) < 4 * found.deviations).all()
    np.testing.assert_array_equal(fit(slopes, jobs=3).values, found.values)


def test_what_has_no_effect_or_that_of_another_stays_as_it_was():
    slopes = RANDOM.normal(size=(N, 3))
    slopes[:, 2] = 0.0
    found = fit(slopes)
    assert list(found.told) == [True, True, False]
    assert found.values[2] == 0.0
    assert np.isinf(found.deviations[2])
    slopes[:, 2] = slopes[:, 1]
    found = fit(slopes)
    assert found.told[0]
    assert found.told[1:].sum() == 1
    assert found.values[1:].sum() == pytest.approx(TRUTH[1:].sum(), abs=0.02)
    # The other may be a unit off, and so what is told is.
    assert found.deviations[1:].min() == pytest.approx(1.0, rel=0.01)


def test_noise_as_large_as_the_effect_tells_nothing():
    found = fit(0.001 * RANDOM.normal(size=(50, 3)), noise=1.0)
    assert not found.told.any()
    np.testing.assert_array_equal(found.values, 0.0)


def test_errors_that_go_on_count_once():
    """Every error stays for 20 samples: the deviations are as of a twentieth of the samples."""
    slope = RANDOM.normal(size=(N, 1)).cumsum(axis=0) / 30.0
    error = np.repeat(RANDOM.standard_normal(N // 20), 20)
    one = np.ones(1)
    found, alone = (
        estimate(
            lambda values, noise=noise: [slope * values - noise[:, None]],
            0 * one, one, (-9 * one, 9 * one), 0.0,
        )
        for noise in (error, RANDOM.standard_normal(N))
    )  # fmt: skip
    assert found.deviations[0] / alone.deviations[0] == pytest.approx(np.sqrt(20), rel=0.25)


def test_nothing_is_known_better_than_it_was_measured():
    slopes = RANDOM.normal(size=(N, 3))
    exact = fit(slopes, noise=0.0, resolution=0.05)
    np.testing.assert_allclose(exact.deviations, 0.05 / np.sqrt(N), rtol=0.15)


def test_bounds_are_kept_and_one_parabola_is_followed_to_its_bottom():
    slopes = RANDOM.normal(size=(N, 3))
    found = fit(slopes, bounds=(np.full(3, -1.0), np.full(3, 9.0)))
    assert found.values[1] == pytest.approx(-1.0, abs=1e-3)
    along = np.linspace(0, 1, 50)[:, None]
    bent = estimate(
        lambda values: [np.exp(values[0] * along) - np.exp(1.3 * along)],
        np.zeros(1), np.full(1, 0.1), (np.full(1, -5.0), np.full(1, 5.0)), 1e-4,
    )  # fmt: skip
    assert bent.values[0] == pytest.approx(1.3, abs=1e-3)
