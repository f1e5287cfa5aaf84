import sys

import numpy as np
import pytest

from besman.exceptions import TransferError
from besman.transfer.nsga2 import nsga2

SECOND = np.array([2.0, 1.0, -1.0])


def costs(points):
    """Squared distances to two places: no point off the straight line between them is needed."""
    return np.column_stack([(points**2).sum(axis=1), ((points - SECOND) ** 2).sum(axis=1)])


def found(seed=1, generations=120):
    first = np.random.default_rng(0).uniform(-3, 3, (24, 3))
    return nsga2(costs, first, (-3.0, 3.0), 24, generations, seed)


def test_the_front_of_two_distances_is_the_line_between():
    points = found()
    along = points @ SECOND / (SECOND @ SECOND)
    off = np.linalg.norm(points - along[:, None] * SECOND, axis=1)
    assert np.median(off) < 0.25
    assert along.min() < 0.1
    assert along.max() > 0.9
    assert np.diff(np.sort(along)).max() < 0.3


def test_no_point_of_a_front_is_better_than_another_in_everything():
    values = costs(found(generations=5))
    better = (values[:, None] <= values[None]).all(axis=2) & (values[:, None] < values[None]).any(
        axis=2
    )
    assert not better.any()


def test_the_same_seed_gives_the_same_points():
    np.testing.assert_array_equal(found(), found())
    assert not np.array_equal(found(seed=2), found())


def test_first_points_are_moved_into_the_bounds():
    seen = []

    def watched(points):
        seen.append(points)
        return costs(points)

    nsga2(watched, [[9.0, 0, 0], [0, -9.0, 0], [1, 1, 1], [0, 0, 0]], (-3.0, 3.0), 4, 2, 1)
    assert np.abs(np.concatenate(seen)).max() <= 3.0


def test_without_pymoo_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymoo.algorithms.moo.nsga2", None)
    with pytest.raises(TransferError, match=r"is not installed; pip install 'besman\[transfer\]'"):
        found()
