"""The acceleration that tells free fall, held against SciPy's filter and a parabola."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from besman.stages.select.flight import GRAVITY, find_acceleration


@pytest.mark.parametrize(("window", "rate_hz"), [(5, 50.0), (9, 100.0), (45, 500.0)])
def test_acceleration_is_that_of_savitzky_and_golay(window, rate_hz):
    path = np.random.default_rng(0).normal(size=(window + 20, 3)).cumsum(axis=0)
    path[window + 4, 1] = np.nan
    expected = savgol_filter(
        path, window, 2, deriv=2, delta=1 / rate_hz, axis=0, mode="constant", cval=np.nan
    )
    found = find_acceleration(path, window, rate_hz)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.isfinite(find_acceleration(path[:window], window, rate_hz)).sum() == 3


def test_a_parabola_is_found_in_full():
    time = np.arange(0, 0.4, 0.01)
    path = np.stack([1.0 + 2.0 * time, 0 * time, -0.5 * GRAVITY * time**2], axis=1)
    found = find_acceleration(path, 9, 100.0)[4:-4]
    np.testing.assert_allclose(found, np.tile([0.0, 0.0, -GRAVITY], (len(found), 1)), atol=1e-9)
