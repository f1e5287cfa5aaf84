import numpy as np

from besman.refinement.cma_es import CmaEs


def minimise(function, search, generations):
    best = -np.inf
    for _ in range(generations):
        points = search.ask()
        returns = np.array([-function(point) for point in points])
        search.tell(points, returns)
        best = max(best, returns.max())
    return best


def test_finds_the_minimum_of_rosenbrocks_function():
    def rosenbrock(x):
        return np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)

    assert minimise(rosenbrock, CmaEs(np.zeros(5), 0.5, None, (0,)), 300) > -1e-8


def global_state():
    return np.random.get_state()[1].copy()  # noqa: NPY002 - the one that cma would use


def test_searches_side_by_side_do_not_disturb_each_other():
    def sphere(x):
        return np.sum((x - 1) ** 2)

    before = global_state()
    alone = CmaEs(np.zeros(4), 0.5, 8, (1, 2))
    minimise(sphere, alone, 5)
    first, second = CmaEs(np.zeros(4), 0.5, 8, (1, 2)), CmaEs(np.zeros(4), 0.5, 8, (1, 3))
    for _ in range(5):
        for search in (first, second):
            minimise(sphere, search, 1)
    points = first.ask()
    np.testing.assert_array_equal(points, alone.ask())
    assert points.shape == (8, 4)
    assert not (points == second.ask()).all()
    assert (global_state() == before).all()


def test_a_return_that_is_no_number_is_the_worst():
    def broken(x):
        return np.nan if x[0] > 1 else np.sum((x + 1) ** 2)

    search = CmaEs(np.zeros(3), 0.5, None, (0,))
    for _ in range(60):
        points = search.ask()
        search.tell(points, np.array([-broken(point) for point in points]))
    np.testing.assert_allclose(search.ask().mean(axis=0), -1, atol=0.1)


def test_knows_when_it_has_converged():
    search = CmaEs(np.zeros(2), 0.5, None, (0,))
    assert not search.exhausted
    minimise(lambda x: np.sum(x**2), search, 400)
    assert search.exhausted
