"""A movement that waits where it is at rest."""

import numpy as np

from besman.motion.waits import add_waits


def test_its_own_clock_stands_still_for_as_long_as_it_waits():
    """Integrated step by step: 1 while it goes on, 0 while it waits."""
    waits = add_waits([1.0, 2.5], [0.5, 0.25])
    np.testing.assert_allclose(waits.starts_s, [1.0, 3.0])
    time = np.arange(0.0, 5.0, 0.001)
    own, moving = waits.own_time(time)
    np.testing.assert_allclose(
        own, np.concatenate([[0], np.cumsum(moving[:-1])]) * 0.001, atol=2e-3
    )
    np.testing.assert_allclose(own[-1], time[-1] - waits.sum_s)
    assert not moving[np.searchsorted(time, 3.1)]


def test_without_waits_it_is_the_same_clock():
    waits = add_waits([], [])
    own, moving = waits.own_time([0.0, 1.0])
    np.testing.assert_array_equal(own, [0.0, 1.0])
    assert moving.all()
    assert waits.sum_s == 0.0
