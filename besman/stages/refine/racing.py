"""Races of motions that succeed or not: none is tried farther than another's lead leaves open.

All are tried in the same models in the same order, so that a count of failures decides: who has
failed as often as another in all of them cannot be better any more. That is exact, where races by
Hoeffding's or Bernstein's bounds [1]_ leave a chance of error, and need more models than these.

References
----------
.. [1] V. Heidrich-Meisner, C. Igel: Hoeffding and Bernstein races for selecting policies in
   evolutionary direct policy search. ICML 2009, DOI 10.1145/1553374.1553426.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from besman.simulation.trial import Trial


def race(
    rewards: Sequence[float],
    n_models: int,
    most: int,
    fewest: int,
    attempt: Callable[[int, int], Trial],
) -> list[tuple[Trial, ...]]:
    """Try motions in perturbed models until it is clear which fails least often.

    Parameters
    ----------
    rewards : sequence of float
        In the model as it is: the best starts first.
    n_models : int
        In how many there are to be tried.
    most : int
        How many attempts there may be.
    fewest : int
        How often the best motion so far has failed in all models; `n_models` without one.
    attempt : callable
        Gives what comes of a motion in a model.

    Returns
    -------
    list of tuple of Trial
        Of every motion, in as many models as it was tried in.
    """
    found: list[tuple[Trial, ...]] = [()] * len(rewards)
    for motion in sorted(range(len(rewards)), key=lambda at: -rewards[at]):
        trials: list[Trial] = []
        n_failed = 0
        while len(trials) < n_models and n_failed < fewest and most > 0:
            trials.append(attempt(motion, len(trials)))
            n_failed += not trials[-1].success
            most -= 1
        if len(trials) == n_models:
            fewest = min(fewest, n_failed)
        found[motion] = tuple(trials)
    return found
