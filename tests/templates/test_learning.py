"""Templates learnt on a task that is known in closed form: a ballistic throw."""

import numpy as np
import pytest

from besman.exceptions import ConfigError
from besman.templates.files import parse_settings
from besman.templates.learning import TemplateConfig, Tries, learn_policy
from besman.work.work import Work

REGION = np.array([[0.8, -0.5], [1.8, 0.5]])
GRAVITY = 9.81


def landing(points):
    """A throw from a height of 1 m at 3 m/s, ahead, level; points change speed and directions."""
    speed = 3.0 * np.exp(0.3 * points[:, 0])
    turn, rise = 0.3 * points[:, 1], 0.2 * points[:, 2]
    up = speed * np.sin(rise)
    flight = (up + np.sqrt(up**2 + 2 * GRAVITY)) / GRAVITY
    far = speed * np.cos(rise) * flight
    return np.column_stack([far * np.cos(turn), far * np.sin(turn)])


def throw(points, contexts):
    misses = np.linalg.norm(landing(points) - contexts, axis=1)
    return Tries(contexts, points, -misses, misses, misses < 0.1)


def test_a_level_throw_lands_where_the_formula_says():
    expected = 3.0 * np.sqrt(2 / GRAVITY)
    np.testing.assert_allclose(landing(np.zeros((1, 3))), [[expected, 0.0]])


@pytest.mark.parametrize("method", ["c_reps", "c_cma_es"])
def test_unseen_targets_are_hit(method):
    config = TemplateConfig(method=method, episodes=3000)
    shares = []
    policy, tries, checks = learn_policy(
        config, 3, REGION, throw, Work(progress=shares.append), None, None
    )
    contexts = np.random.default_rng(5).uniform(*REGION, (200, 2))
    misses = np.linalg.norm(landing(policy.means(contexts)) - contexts, axis=1)
    assert np.median(misses) < 0.03
    assert len(tries.rewards) <= 3000
    first, last = tries.rewards[:100].mean(), tries.rewards[-100:].mean()
    assert last > first
    # The checks have no exploration: they are the policy itself.
    np.testing.assert_array_equal(checks.points, policy.means(checks.contexts))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def learn(seed=0, known=None, keep=None, try_points=throw):
    config = TemplateConfig(method="c_reps", episodes=210, population=20, checks=10, seed=seed)
    return learn_policy(config, 3, REGION, try_points, Work(), known, keep)


def test_a_stopped_search_goes_on_where_it_was():
    kept = []

    def stop_after_four(tries):
        kept.append(tries)
        if len(kept) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn(keep=stop_after_four)
    tried = []

    def count(points, contexts):
        tried.append(len(points))
        return throw(points, contexts)

    policy, tries, checks = learn(known=kept[-1], try_points=count)
    whole, all_tries, all_checks = learn()
    assert sum(tried) == 200 - 80 + 10
    np.testing.assert_array_equal(policy.gain, whole.gain)
    np.testing.assert_array_equal(policy.covariance, whole.covariance)
    np.testing.assert_array_equal(tries.rewards, all_tries.rewards)
    np.testing.assert_array_equal(checks.rewards, all_checks.rewards)


def test_episodes_of_another_search_are_not_taken():
    _, other, _ = learn(seed=1)
    policy, _, _ = learn(known=other)
    np.testing.assert_array_equal(policy.gain, learn()[0].gain)


def test_the_seed_matters():
    assert not np.array_equal(learn()[0].gain, learn(seed=1)[0].gain)


def test_failed_episodes_pull_nothing_anywhere():
    def fail_sometimes(points, contexts):
        tries = throw(points, contexts)
        rewards = np.where(np.arange(len(points)) % 5 == 0, np.nan, tries.rewards)
        return Tries(contexts, points, rewards, tries.misses, tries.successes)

    policy, _, _ = learn(try_points=fail_sometimes)
    assert np.isfinite(policy.gain).all()


def test_fewer_episodes_than_a_generation_are_one_generation():
    config = TemplateConfig(episodes=7, checks=10)
    assert config.generation(3, 2) == 7
    _, tries, _ = learn_policy(config, 3, REGION, throw)
    assert len(tries.rewards) == 7


@pytest.mark.parametrize(
    ("given", "settings", "message"),
    [
        ({"episodes": 0}, (), r"template: episodes: .*greater than or equal to 1"),
        ({"method": "reps"}, (), r"template: method: got 'reps'; did you mean 'c_reps'\? all"),
        ({}, ("populaton=20",), r"template: .*populaton.*population"),
        ({}, ("population",), r"--set: got 'population', expected KEY=VALUE"),
        ({}, ("search=[goal",), r"--set search: got '\[goal', which is not a YAML value"),
    ],
)
def test_wrong_settings_say_so(given, settings, message):
    with pytest.raises(ConfigError, match=message):
        parse_settings(given, settings)
