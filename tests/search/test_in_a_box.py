import threading
from typing import get_args

import numpy as np
import pytest

from besman.search.in_a_box import Optimizer, make_box_search

LOW, HIGH = np.full(3, -4.0), np.full(3, 4.0)
BEST = np.array([1.0, -2.0, 0.5])


def bowl(points):
    return np.sum((points - BEST) ** 2, axis=1)


def run(optimizer, seed=0, generations=60, start=(0.0, 0.0, 0.0)):
    search = make_box_search(optimizer, np.array(start), LOW, HIGH, seed)
    tried = []
    for _ in range(generations):
        if search.exhausted:
            break
        points = search.ask()
        search.tell(points, bowl(points))
        tried.append(points)
    search.close()
    return np.concatenate(tried)


@pytest.mark.parametrize("optimizer", get_args(Optimizer))
def test_finds_the_least_of_a_bowl_inside_the_box(optimizer):
    tried = run(optimizer)
    assert bowl(tried).min() < 1e-2
    assert np.all(tried >= LOW)
    assert np.all(tried <= HIGH)


@pytest.mark.parametrize("optimizer", get_args(Optimizer))
def test_the_same_seed_tries_the_same_points(optimizer):
    assert run(optimizer, generations=5).tobytes() == run(optimizer, generations=5).tobytes()
    other = run(optimizer, seed=3, generations=5)
    assert other.tobytes() != run(optimizer, generations=5).tobytes()


@pytest.mark.parametrize("optimizer", get_args(Optimizer))
def test_ends_by_itself_when_nothing_is_left_to_gain(optimizer):
    assert len(run(optimizer, generations=2000)) < 2000 * 8


def test_an_abandoned_search_leaves_no_thread():
    before = threading.active_count()
    run("differential_evolution", generations=3)
    assert threading.active_count() == before


def test_differential_evolution_tries_the_start():
    tried = run("differential_evolution", generations=1, start=(0.25, 0.5, -1.0))
    assert np.any(np.all(np.isclose(tried, [0.25, 0.5, -1.0]), axis=1))
