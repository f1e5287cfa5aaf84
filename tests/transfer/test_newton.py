"""Newton steps on throws without an arm; see `ballistic_throws`."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from ballistic_throws import DIMENSION, TARGET, BallSimulator, real

from besman.transfer.approach import RealTry, TransferConfig
from besman.transfer.archive import no_plans
from besman.transfer.newton import suggest_next


def tries_until(gain, fails=lambda number: False, accept=lambda point: True):
    """Return the misses of tries until one is within 5 cm, and all points."""
    archive, tries, misses, points = no_plans(DIMENSION), [], [], []
    simulator = BallSimulator()
    for number in range(10):
        choice = suggest_next(simulator, archive, tries, TARGET, TransferConfig(), accept)
        archive = choice.archive
        points.append(archive.points[choice.row])
        outcome = np.full(2, np.nan) if fails(number) else real(points[-1], gain)
        tries.append(RealTry(choice.row, outcome))
        misses.append(float(np.linalg.norm(outcome - TARGET)))
        if misses[-1] <= 0.05:
            break
    return misses, points


@pytest.mark.parametrize("gain", [0.7, 0.85, 1.15])
def test_few_tries_though_the_simulation_is_wrong(gain):
    misses, points = tries_until(gain)
    assert misses[0] > 0.15
    assert not points[0].any()
    assert len(misses) <= 4
    assert misses[-1] <= 0.05
    # Coordinates that change nothing stay where they are.
    assert np.abs(np.array(points)[:, 5:]).max() < 1e-9


def test_the_expected_landing_is_that_of_the_corrected_simulation():
    simulator = BallSimulator()
    first = suggest_next(simulator, no_plans(DIMENSION), (), TARGET, TransferConfig())
    np.testing.assert_allclose(first.landing, TARGET)
    outcome = TARGET + np.array([0.3, -0.1])
    tried = [RealTry(first.row, outcome)]
    choice = suggest_next(simulator, first.archive, tried, TARGET, TransferConfig())
    simulated = choice.archive.outcomes[choice.row]
    np.testing.assert_allclose(choice.landing, simulated + outcome - TARGET)
    assert np.linalg.norm(choice.landing - TARGET) < 0.02


def test_after_a_failure_the_step_is_half_as_long():
    _, points = tries_until(0.8, fails=lambda number: number == 1)
    np.testing.assert_allclose(points[2], 0.5 * points[1], atol=1e-12)
    misses, _ = tries_until(0.8, fails=lambda number: number == 1)
    assert misses[-1] <= 0.05


def test_what_the_arm_may_not_do_is_not_tried():
    allowed = lambda point: np.linalg.norm(point) < 0.3  # noqa: E731
    _, points = tries_until(0.7, accept=allowed)
    assert all(allowed(point) for point in points)


def test_where_all_fails_the_other_approach_goes_on(monkeypatch):
    """Every real try fails: there is nothing to step from."""
    asked = []
    monkeypatch.setattr(
        "besman.transfer.newton.suggest",
        lambda *arguments: asked.append(arguments) or SimpleNamespace(row=0),
    )
    simulator = BallSimulator()
    first = suggest_next(simulator, no_plans(DIMENSION), (), TARGET, TransferConfig())
    failed = [RealTry(first.row, np.full(2, np.nan))]
    suggest_next(simulator, first.archive, failed, TARGET, TransferConfig())
    assert asked[0][4].surrogate == "gaussian_process"
    suggest_next(simulator, first.archive, (), TARGET, TransferConfig(surrogate="inverse_distance"))
    assert asked[1][4].surrogate == "inverse_distance"


def test_one_motion_may_be_tried_twice():
    """As the arm does not throw twice alike: the better of both outcomes counts."""
    first = suggest_next(BallSimulator(), no_plans(DIMENSION), (), TARGET, TransferConfig())
    tried = [RealTry(first.row, TARGET + far) for far in (np.array([0.4, 0.0]), np.array([0.2, 0]))]
    both = suggest_next(BallSimulator(), first.archive, tried, TARGET, TransferConfig())
    better = suggest_next(BallSimulator(), first.archive, tried[1:], TARGET, TransferConfig())
    np.testing.assert_array_equal(both.landing, better.landing)


def test_an_arm_that_is_known_is_aimed_at_with_the_first_try():
    """The model throws as the arm does; what is kept is what the simulation as it is says."""

    class Known(BallSimulator):
        def simulate(self, points, jobs=1):
            landed = np.array([real(point, 0.8) for point in points])
            return replace(super().simulate(points), outcomes=landed)

    usual, known, config = BallSimulator(), Known(), TransferConfig()
    first = suggest_next(usual, no_plans(DIMENSION), (), TARGET, config, model=known)
    (point,) = first.archive.points
    assert np.linalg.norm(real(point, 0.8) - TARGET) < 0.02
    np.testing.assert_allclose(first.landing, real(point, 0.8))
    np.testing.assert_array_equal(first.archive.outcomes, usual.simulate(point[None]).outcomes)
    # Where it comes down elsewhere all the same, the next try makes up for that too.
    tried = [RealTry(first.row, first.landing + np.array([0.15, 0.1]))]
    second = suggest_next(usual, first.archive, tried, TARGET, config, model=known)
    expected = real(second.archive.points[second.row], 0.8) + np.array([0.15, 0.1])
    np.testing.assert_allclose(second.landing, expected, atol=1e-9)
    assert np.linalg.norm(expected - TARGET) < 0.02


def test_where_the_model_throws_nothing_the_refined_motion_comes_first():
    class Fails(BallSimulator):
        def simulate(self, points, jobs=1):
            found = super().simulate(points)
            return replace(found, outcomes=np.full_like(found.outcomes, np.nan))

    first = suggest_next(
        BallSimulator(), no_plans(DIMENSION), (), TARGET, TransferConfig(), model=Fails()
    )
    assert not first.archive.points[first.row].any()
