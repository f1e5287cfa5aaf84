import numba
import numpy as np
import pytest

from besman.classifiers.dtw_kernel import nearest_warped, squared_distance


def walks(n, seed):
    return np.random.default_rng(seed).normal(size=(n, 8, 2)).cumsum(axis=1)


@pytest.fixture(scope="module")
def metrics():
    """Return tslearn's metrics as plain Python: compiling them takes five seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba.config, "DISABLE_JIT", True)
        return pytest.importorskip("tslearn.metrics")


@pytest.mark.parametrize("band", [0, 1, 3, 40])
def test_the_nearest_example_is_that_of_tslearn(metrics, band):
    """Also where it gives up examples early, and where the band is wider than the sequences."""
    sequences, examples = walks(9, 0), walks(12, 1)
    apart = metrics.cdist_dtw(
        sequences, examples, global_constraint="sakoe_chiba", sakoe_chiba_radius=band
    )
    index, distance = nearest_warped(sequences, examples, band)
    np.testing.assert_allclose(distance, apart.min(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(index, apart.argmin(axis=1))


@pytest.mark.parametrize("band", [0, 2, 9])
def test_a_distance_is_the_least_over_all_paths_or_given_up(band):
    first, second = walks(2, 2)[:, :5]
    cost = np.full((6, 6), np.inf)
    cost[0, 0] = 0.0
    for i, k in np.ndindex(5, 5):
        if abs(i - k) <= band:
            least = min(cost[i, k], cost[i, k + 1], cost[i + 1, k])
            cost[i + 1, k + 1] = least + np.sum((first[i] - second[k]) ** 2)
    expected = cost[-1, -1]
    assert squared_distance(first, second, band, np.inf) == pytest.approx(expected)
    assert squared_distance(first, second, band, 1.01 * expected) == pytest.approx(expected)
    assert squared_distance(first, second, band, 0.1 * expected) == np.inf


def test_of_equal_examples_the_first_is_the_nearest():
    examples = np.repeat(walks(1, 3), 3, axis=0)
    index, distance = nearest_warped(examples[:1], examples, 2)
    assert index[0] == 0
    assert distance[0] == 0
