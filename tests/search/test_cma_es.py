import numpy as np

from besman.search.cma_es import CmaEs


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


def test_is_cma_itself():
    import cma

    random = np.random.default_rng((3, 4))
    options = {"randn": lambda *s: random.standard_normal(s), "seed": np.nan, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(np.ones(4), 0.3, {**options, "popsize": 10})
    search = CmaEs(np.ones(4), 0.3, 10, (3, 4))
    for _ in range(20):
        points = search.ask()
        np.testing.assert_array_equal(points, strategy.ask())
        search.tell(points, -rastrigin(points))
        strategy.tell(list(points), rastrigin(points).tolist())


def rastrigin(x):
    return np.sum(x**2 - 10 * np.cos(2 * np.pi * x) + 10, axis=-1)


def populations(search, episodes):
    """Run until the budget or the end; return the population of every start in order."""
    sizes, strategy, best = [], None, -np.inf
    tried = 0
    while tried < episodes and not search.exhausted:
        points = search.ask()
        if search._strategy is not strategy:
            strategy = search._strategy
            sizes.append(len(points))
        returns = -rastrigin(points)
        search.tell(points, returns)
        tried, best = tried + len(points), max(best, returns.max())
    return sizes, best


def test_restarts_double_the_population_and_leave_local_optima():
    start = np.full(3, 3.3)
    assert populations(CmaEs(start, 0.3, 6, (0,)), 30_000)[1] < -0.9
    sizes, best = populations(CmaEs(start, 2.0, 6, (0,), restarts="ipop", n_restarts=5), 30_000)
    assert sizes == [6, 12, 24, 48, 96, 192][: len(sizes)]
    assert len(sizes) > 3
    assert best > -1e-8


def test_bipop_takes_turns_by_what_each_kind_has_had():
    search = CmaEs(np.full(3, 3.3), 2.0, 6, (0,), restarts="bipop", n_restarts=3)
    sizes, best = populations(search, 30_000)
    assert sorted(set(sizes))[-3:] == [12, 24, 48]
    assert len(sizes) > 4
    assert best > -1e-8
    assert search.exhausted


def test_scales_stretch_the_first_generation():
    search = CmaEs(np.zeros(3), 0.1, 4000, (0,), scales=[1.0, 10.0, 100.0])
    np.testing.assert_allclose(search.ask().std(axis=0), [0.1, 1.0, 10.0], rtol=0.05)
