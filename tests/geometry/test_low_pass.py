"""The low-pass filter without delay, held against SciPy's."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from besman.geometry.low_pass import butterworth, low_pass


@pytest.mark.parametrize("rate_hz", [50.0, 119.88, 500.0])
@pytest.mark.parametrize("cutoff_hz", [4.0, 10.0, 22.0])
def test_the_filter_is_scipys(rate_hz: float, cutoff_hz: float) -> None:
    sections = butter(2, cutoff_hz, fs=rate_hz, output="sos")
    ahead, back = butterworth(rate_hz, cutoff_hz)
    np.testing.assert_allclose(sections[0], [*ahead, *back], rtol=1e-12)
    values = np.random.default_rng(0).normal(size=(80, 3, 2)).cumsum(axis=0)
    for n_beyond in (0, 1, 79):
        expected = sosfiltfilt(sections, values, axis=0, padlen=n_beyond)
        found = low_pass(values, rate_hz, cutoff_hz, n_beyond)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_sine_is_weakened_twice_as_a_filter_of_second_order_does() -> None:
    time = np.arange(0, 4, 0.001)
    found = low_pass(np.sin(2 * np.pi * 20.0 * time), 1000.0, 10.0, 300)
    # At twice the cutoff: 1 / sqrt(1 + 2^4), forwards and backwards.
    assert np.abs(found[1000:3000]).max() == pytest.approx(1.0 / 17.0, rel=0.02)


def test_nans_stay_in_their_column() -> None:
    values = np.zeros((30, 2))
    values[3, 0] = np.nan
    assert np.isfinite(low_pass(values, 100.0, 10.0, 20)[:, 1]).all()
