"""Steps from one place after another, on made-up outcomes that agree near one place alone."""

import numpy as np

from besman.search.gauss_newton import GaussNewton
from besman.search.relay import Relay
from besman.search.residual_points import rms

SLOPE = np.random.default_rng(0).normal(size=(2, 5))
GOOD, BAD = np.zeros(5), np.full(5, 6.0)
APART = np.array([[0.0, 0.0], [1.0, 0.5], [-1.0, -0.5]])


def evaluate(point):
    """Hit in every world near one place; elsewhere worlds are apart whatever is changed."""
    away = np.linalg.norm(point - GOOD) > 5.0
    return SLOPE @ (point - GOOD) * (0.1 if away else 1.0) + 2.0 * away * APART


def relay_of(*places, waits=False):
    slopes = np.stack([SLOPE] * 3)
    options = {"sigma": 0.5, "population": 8, "seed": (0,), "jacobian": slopes}
    return Relay([GaussNewton(GOOD, first=place, **options) for place in places], waits)


def run(search, most=60):
    """Ask and tell until it ends or hits in all worlds; return the points and the last cost."""
    points, cost = [], np.inf
    while not search.exhausted and len(points) < most and cost > 0.1:
        asked, in_worlds = search.ask(), search.in_worlds
        found = np.stack([evaluate(point) for point in asked])[:, : 3 if in_worlds else 1]
        cost = min(rms(one) for one in found) if in_worlds else np.inf
        points += list(asked)
        search.tell(asked, -np.array([rms(one) for one in found]), found)
    return np.array(points), cost


def test_what_stalls_at_one_place_gets_on_at_the_next():
    _, alone = run(relay_of(BAD))
    assert alone > 1.0
    points, cost = run(relay_of(BAD, GOOD + 0.3))
    assert cost <= 0.1
    assert np.linalg.norm(points[-1] - GOOD) < 2.0


def test_it_waits_where_it_would_go_elsewhere_and_has_tried_the_same_by_then():
    waits = relay_of(BAD, waits=True)
    first, cost = run(waits)
    assert waits.waiting
    assert waits.exhausted
    assert cost > 1.0
    waits.hand_over()
    assert not waits.handed_over
    for others in ((), (GOOD + 0.3,)):
        points, _ = run(relay_of(BAD, *others))
        np.testing.assert_array_equal(points[: len(first)], first)
        assert len(points) > len(first)


def test_after_the_last_place_the_nearest_goes_on():
    search = relay_of(BAD, BAD + 1.0)
    points, cost = run(search, most=200)
    assert cost > 1.0
    assert not search.waiting
    # To its own end, beyond where it was left.
    assert search.exhausted
    waits, _ = run(relay_of(BAD, BAD + 1.0, waits=True))
    assert len(points) > len(waits)


def test_what_hits_in_all_worlds_already_is_not_left():
    """Steps in vain after a hit are the search's own to end."""
    search = relay_of(GOOD, BAD, waits=True)
    for _ in range(30):
        if search.exhausted:
            break
        asked, in_worlds = search.ask(), search.in_worlds
        found = np.full((len(asked), 3 if in_worlds else 1, 2), 0.6 if in_worlds else 0.0)
        search.tell(asked, np.zeros(len(asked)), found)
    assert search.exhausted
    assert not search.waiting
