"""Gauss-Newton on made-up outcomes whose Jacobian and spread are known."""

import numpy as np
import pytest

from besman.search.gauss_newton import GaussNewton
from besman.search.residual_points import rms

RNG = np.random.default_rng(0)
SLOPE = RNG.normal(size=(2, 5))
TARGET = np.array([1.5, -0.7])


def residuals_of(point, slopes=SLOPE[None], curve=0.0):
    off = slopes @ point - TARGET
    return off + curve * np.sin(3.0 * point[:2])


def search_of(jacobian, **more):
    return GaussNewton(np.zeros(5), 0.5, 8, (0,), jacobian=jacobian, **more)


def run(search, evaluate, most=30, enough=0.0):
    """Ask and tell until it ends; return the points and their costs."""
    points, costs = [], []
    while not search.exhausted and len(points) < most:
        asked = search.ask()
        found = np.stack([evaluate(point) for point in asked])
        if not search.in_worlds:
            found = found[:, :1]
        cost = [rms(one) for one in found]
        points += list(asked)
        costs += cost
        if min(cost) <= enough:
            break
        search.tell(asked, -np.nan_to_num(np.array(cost), nan=9.0), found)
    return np.array(points), np.array(costs)


def test_a_linear_outcome_is_reached_by_the_step_of_least_norm():
    search = search_of(SLOPE[None], damping=1e-9)
    search.tell_start(np.zeros(5), residuals_of(np.zeros(5)))
    np.testing.assert_allclose(search.ask()[0], np.linalg.pinv(SLOPE) @ TARGET, atol=1e-6)


def test_a_step_is_of_least_norm_in_trusted_units():
    trust = np.array([1.0, 0.5, 0.1, 1.0, 0.0])
    search = search_of(SLOPE[None], damping=1e-9, trust=trust)
    search.tell_start(np.zeros(5), 0.2 * residuals_of(np.zeros(5)))
    expected = trust * (np.linalg.pinv(SLOPE * trust) @ (0.2 * TARGET))
    np.testing.assert_allclose(search.ask()[0], expected, atol=1e-6)
    assert search.ask()[0, 4] == 0.0


def test_steps_begin_where_another_motion_has_ended_if_that_is_nearer():
    """What it has gained there is expected here; the step goes on from there."""
    first = np.array([0.5, -0.2, 0.1, 0.0, 0.3])
    start = residuals_of(np.zeros(5))
    for gained, begins in ((SLOPE @ first, True), (-1.1 * start, False), (10 * start, None)):
        search = search_of(SLOPE[None], damping=1e-9, first=first, gained=gained)
        search.tell_start(np.zeros(5), start)
        off = (start + gained)[0]
        there = first - np.linalg.pinv(SLOPE) @ off if begins else first
        expected = np.linalg.pinv(SLOPE) @ TARGET if begins is None else there
        np.testing.assert_allclose(search.ask()[0], expected, atol=1e-6)
    search = search_of(SLOPE[None], first=first, gained=[np.nan, np.nan])
    search.tell_start(np.zeros(5), np.full((1, 2), np.nan))
    np.testing.assert_array_equal(search.ask(), [first])


def test_steps_leave_what_changes_no_outcome_where_it_is():
    search = search_of(SLOPE[None])
    points, costs = run(search, lambda point: residuals_of(point, curve=0.2), enough=1e-3)
    assert costs[-1] <= 1e-3
    free = np.linalg.svd(SLOPE)[2][2:]
    np.testing.assert_allclose(points @ free.T, 0.0, atol=1e-9)


def test_a_jacobian_of_another_motion_is_corrected():
    search = search_of(SLOPE[None] + 0.3 * RNG.normal(size=(1, 2, 5)), steps=20)
    _, costs = run(search, residuals_of, enough=1e-3)
    assert costs[-1] <= 1e-3
    assert not search.handed_over


def test_the_update_makes_the_last_step_exact():
    """Broyden's secant condition, in all worlds as far as the last step is believed."""
    search = search_of(np.stack([SLOPE, SLOPE]))
    search.enter_worlds(np.zeros(5))
    slopes = np.stack([2.0 * SLOPE, 1.5 * SLOPE])
    (first,) = search.ask()
    search.tell(first[None], np.zeros(1), residuals_of(first, slopes)[None])
    (second,) = search.ask()
    search.tell(second[None], np.zeros(1), residuals_of(second, slopes)[None])
    told = (search.jacobian @ (second - first)).mean(axis=0)
    np.testing.assert_allclose(told, (slopes @ (second - first)).mean(axis=0), atol=1e-9)


def test_worlds_come_closer_along_the_free_directions():
    """Two worlds whose outcomes agree at one point of the plane that hits the target."""
    slopes = np.stack([SLOPE, SLOPE + np.diag([0.4, 0.4]) @ RNG.normal(size=(2, 5))])
    apart = np.array([[0.5, 0.2], [-0.5, -0.2]])

    def evaluate(point):
        return residuals_of(point, slopes) + apart

    search = search_of(slopes, steps=20, damping=1e-3)
    _, costs = run(search, evaluate, enough=0.02)
    assert costs[-1] <= 0.02
    # In one world alone none would have been missed.
    assert rms(evaluate(np.linalg.pinv(SLOPE) @ (TARGET - apart[0]))) > 0.3


def test_steps_in_the_model_alone_keep_the_worlds_as_near_as_they_were():
    """Least squares of what is foreseen in all of them, by another solver."""
    slopes = SLOPE + np.concatenate([np.zeros((1, 2, 5)), RNG.normal(size=(3, 2, 5))])
    search = search_of(slopes, damping=1e-9, first=np.ones(5))
    begin, first = search.ask()[0], np.array([0.9, -0.6])
    search.tell(begin[None], np.zeros(1), first[None, None])
    (point,) = search.ask()
    step = np.linalg.lstsq(slopes.reshape(8, 5), -np.tile(first, 4), rcond=None)[0]
    np.testing.assert_allclose(point - begin, step, atol=1e-6)
    search.tell(point[None], np.zeros(1), 0.9 * first[None, None])
    (after,) = search.ask()
    foreseen = 0.9 * first + (slopes - slopes[0]) @ (point - begin)
    step = np.linalg.lstsq(search.jacobian.reshape(8, 5), -foreseen.ravel(), rcond=None)[0]
    np.testing.assert_allclose(after - point, step, atol=1e-6)
    assert not search.in_worlds


def test_the_model_alone_comes_first_and_then_all_worlds():
    search = search_of(np.stack([SLOPE] * 3))
    assert search.n_worlds == 3
    assert not search.in_worlds
    seen = []
    while not search.exhausted and len(seen) < 20:
        (point,) = search.ask()
        seen.append(search.in_worlds)
        found = residuals_of(point, np.stack([SLOPE] * 3))
        search.tell(point[None], np.zeros(1), found[None] if search.in_worlds else found[None, :1])
    assert seen == sorted(seen)
    assert seen[-1]


def test_behind_a_cliff_it_goes_back():
    def evaluate(point):
        return residuals_of(point) if np.linalg.norm(point) < 0.8 else np.full((1, 2), np.nan)

    search = search_of(SLOPE[None], first=np.full(5, 1.0))
    points, _ = run(search, evaluate, most=12)
    np.testing.assert_allclose(points[1], 0.5 * points[0])
    assert np.isfinite(evaluate(points[2])).all()


@pytest.mark.parametrize(
    "evaluate",
    [
        lambda point: np.full((1, 2), np.nan),
        lambda point: residuals_of(np.zeros(5)) + 0.0 * point[0],
    ],
    ids=["no outcome", "an outcome that nothing moves"],
)
def test_where_steps_stall_cma_es_goes_on(evaluate):
    search = search_of(SLOPE[None])
    points, _ = run(search, evaluate, most=40)
    assert search.handed_over
    assert len(np.unique(points, axis=0)) > 8


def test_without_a_jacobian_or_residuals_it_is_cma_es():
    alone = search_of(None)
    assert alone.n_worlds == 1
    assert alone.ask().shape == (8, 5)
    blind = search_of(SLOPE[None])
    blind.tell(blind.ask(), np.zeros(1))
    assert blind.ask().shape == (8, 5)


def test_what_cma_es_brings_near_is_looked_at_in_all_worlds():
    search = search_of(np.stack([SLOPE] * 2), steps=1)
    search.tell(search.ask(), np.zeros(1), np.full((1, 1, 2), np.nan))
    assert search.handed_over
    asked = search.ask()
    found = np.full((len(asked), 1, 2), 5.0)
    found[3] = 0.1
    search.tell(asked, np.zeros(len(asked)), found)
    assert search.in_worlds
    np.testing.assert_array_equal(search.ask()[0], asked[3])


def test_bounds_hold_for_steps():
    search = search_of(SLOPE[None], bounds=(-0.1, 0.1))
    points, _ = run(search, residuals_of, most=30)
    assert np.abs(points).max() <= 0.1


def test_a_world_without_an_outcome_is_the_farthest():
    """A step into the void must never look like one nearer to the target."""
    assert rms(np.array([[np.nan, np.nan]])) == np.inf
    assert rms(np.array([[7.0, 0.0], [np.nan, 0.0]])) == pytest.approx(7.0)
    assert rms(np.array([[0.5, 0.0], [np.nan, 0.0]])) == pytest.approx(np.sqrt((0.25 + 9.0) / 2))


def test_where_the_first_point_leads_nowhere_it_begins_again_at_the_start():
    """The start's outcome is known; nothing comes of any point on the other side."""
    first = np.full(5, -4.0)

    def evaluate(point):
        found = residuals_of(point, np.stack([SLOPE, SLOPE]))
        return found if point[0] > -1e-9 else np.full((2, 2), 8.0)

    search = search_of(np.stack([SLOPE, SLOPE]), first=first)
    search.tell_start(np.zeros(5), evaluate(np.zeros(5))[:1])
    points, costs = run(search, evaluate, most=40, enough=0.1)
    assert costs[-1] <= 0.1
    assert not search.handed_over
    assert points[:, 0].all()  # the start is not tried a second time


def test_where_steps_stall_the_jacobian_is_measured_along_what_matters_most():
    """One world of a linear outcome: afterwards the Jacobian is right along those directions."""
    given = np.stack([SLOPE, SLOPE + 0.3 * np.roll(SLOPE, 1, axis=1)])
    search = search_of(given, steps=1)
    search.enter_worlds(np.zeros(5))
    truth = np.stack([SLOPE[::-1], SLOPE[::-1]])
    while len(asked := search.ask()) == 1:
        # As if every step led away, so that nothing is learnt but by measuring.
        found = residuals_of(np.zeros(5), truth) * (1.0 + np.any(asked))
        search.tell(asked, np.zeros(1), found[None])
    wrong = search.jacobian.copy()
    directions = asked / np.linalg.norm(asked, axis=1)[:, None]
    np.testing.assert_allclose(directions @ directions.T, np.eye(len(asked)), atol=1e-9)
    rows = wrong.reshape(-1, 5)
    np.testing.assert_allclose(rows @ directions.T @ directions, rows, atol=1e-9)
    residuals = np.stack([residuals_of(point, truth) for point in asked])
    search.tell(asked, np.zeros(len(asked)), residuals)
    mean = search.jacobian.mean(axis=0) @ directions.T
    # But for what all that was tried before says, which led away.
    np.testing.assert_allclose(mean, SLOPE[::-1] @ directions.T, atol=0.1)
    assert np.abs(rows.reshape(2, 2, 5).mean(axis=0) @ directions.T - mean).max() > 0.5
    assert len(search.ask()) == 1


def test_where_all_worlds_are_off_alike_the_first_alone_is_measured():
    """What is shared says little of the coordinates that alone move the outcomes."""
    slopes = np.stack([SLOPE * [0.0, 0.0, 1.0, 1.0, 1.0]] * 3)
    search = search_of(np.stack([SLOPE * [3.0, 3.0, 0.02, 0.02, 0.02]] * 3), steps=20)
    search.enter_worlds(np.zeros(5))
    n_worlds = []
    while not search.exhausted and len(n_worlds) < 60:
        asked = search.ask()
        seen = slopes if search.in_worlds else slopes[:1]
        found = np.stack([residuals_of(point, seen) for point in asked])
        n_worlds.append((len(asked), len(seen)))
        search.tell(asked, np.zeros(len(asked)), found)
    # Along all five coordinates at once, each for one episode.
    assert (5, 1) in n_worlds
    assert not any(n > 1 and worlds > 1 for n, worlds in n_worlds)
    assert n_worlds[-1] == (1, 3)
    assert rms(found[0]) < 0.1


def test_between_generations_of_cma_es_steps_are_tried():
    """What it has tried tells of a Jacobian that was useless; a few generations are enough."""
    search = search_of(1e-3 * SLOPE[None], steps=1)
    search.tell(search.ask(), np.zeros(1), np.full((1, 1, 2), np.nan))
    assert search.handed_over
    sizes, best = [], np.inf
    while best > 0.05 and len(sizes) < 40:
        asked = search.ask()
        found = np.stack([residuals_of(point) for point in asked])
        cost = np.array([rms(one) for one in found])
        sizes.append(len(asked))
        best = min(best, float(cost.min()))
        search.tell(asked, -cost, found)
    assert sizes[0] == 8
    assert 1 in sizes
    assert sum(sizes) < 60
