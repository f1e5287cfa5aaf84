import numpy as np
import pytest

from besman.simulation.trial import Trial
from besman.stages.refine.outcomes import cost_of, holds

RNG = np.random.default_rng(5)


def trials(residuals, failure=""):
    nothing = np.full(3, np.nan)
    return [
        Trial(0.0, 0.0, 0.0, nothing, failure, not failure, np.empty((0, 3)), residual=one)
        for one in np.asarray(residuals, dtype=float)
    ]


def spread_evenly(middle, spread, n=8):
    """Return outcomes on a circle: their mean and root mean square distance to it are exact."""
    angles = 2 * np.pi * np.arange(n) / n
    return np.array([middle, 0.0]) + spread * np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("middle", np.linspace(0.0, 0.9, 7))
def test_what_holds_succeeds_24_times_in_25(middle):
    """The widest spread that is accepted, and outcomes drawn from a normal distribution of it."""
    accepted = [one for one in np.linspace(0.01, 1.0, 100)
                if holds(trials(spread_evenly(middle, one)))]  # fmt: skip
    drawn = [middle, 0.0] + RNG.normal(size=(20_000, 2)) * max(accepted) / np.sqrt(2.0)
    assert (np.linalg.norm(drawn, axis=1) <= 1.0).mean() > 0.955
    assert 0.04 < max(accepted) < 0.56


def test_an_outcome_that_there_is_not_does_not_hold():
    near = spread_evenly(0.0, 0.1)
    assert holds(trials(near))
    assert not holds([*trials(near), *trials(near[:1], "stick dropped")])
    assert not holds(trials(spread_evenly(1.1, 0.01)))
    assert cost_of(trials(near)) == pytest.approx(0.1)
