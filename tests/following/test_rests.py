"""Rests foreseen by how fast the hand still is: against Bayes' rule on known densities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from besman.following.rests import Rests, follows_at_once
from besman.records import LabelledSegments
from besman.records.layers import IDLE

STILL_M_S, FAST, SLOW, SPREAD = 0.01, -2.0, -3.5, 0.6


def _blocks(rests, label="put"):
    """Return one recording of movements, some of them followed by a rest."""
    labels = [part for rest in rests for part in ((label, IDLE) if rest else (label,))]
    starts = 10 * np.arange(len(labels))
    bounds = np.stack([starts, starts + 10], axis=1)
    return LabelledSegments(bounds, tuple(labels), np.zeros(len(labels)), 100.0, "a.tsv")


def _draw(n=2000, seed=2):
    """Return blocks, and a speed for each row: rests come after hands that are still fast."""
    rng = np.random.default_rng(seed)
    found = _blocks(rng.uniform(size=n) < 0.4)
    rest = np.array([label == IDLE for label in found.labels])
    speeds = np.exp(rng.normal(np.where(rest, FAST, SLOW), SPREAD)) - STILL_M_S
    return found, dict(zip(found.bounds[:, 0].tolist(), speeds.tolist(), strict=True))


def test_a_speed_multiplies_the_odds_of_habit_by_the_ratio_of_its_densities():
    found, speeds = _draw()
    rests = Rests([found], lambda _, row: speeds[row])
    before = ["put", "put", IDLE, "put"]
    habit = rests.probability(before)
    for logarithm in (-4.0, -2.75, -1.5):
        ratio = norm.pdf(logarithm, FAST, SPREAD) / norm.pdf(logarithm, SLOW, SPREAD)
        expected = np.log(habit / (1 - habit)) + np.log(ratio)
        p = rests.probability(before, np.exp(logarithm) - STILL_M_S)
        assert np.log(p / (1 - p)) == pytest.approx(expected, abs=0.4)


def test_what_is_not_known_leaves_the_habit():
    found, speeds = _draw(40)
    rests = Rests([found], lambda _, row: speeds[row])
    habit = Rests([found]).probability(["put"])
    assert rests.probability(["put"]) == habit
    assert Rests([found]).probability(["put"], 0.5) == habit
    # After a rest, and at the beginning, nothing has just ended.
    for before in ([], ["put", IDLE]):
        assert rests.probability(before, 0.5) == rests.probability(before)


def test_movements_after_which_nobody_rests_say_nothing_of_speeds():
    found, speeds = _draw(200)
    other = _blocks([False] * 100, "back")
    alone = Rests([found], lambda _, row: speeds[row])
    both = Rests([found, other], lambda own, row: speeds[row] if own is found else 1.0)
    assert both.probability(["put"], 0.2) == alone.probability(["put"], 0.2)


def test_only_what_ends_where_a_block_begins_says_how_that_begins():
    found = _blocks([True, False, False])
    assert [follows_at_once(found, k) for k in range(4)] == [False, True, False, True]
    apart = replace(found, bounds=found.bounds - np.array([[0, 0], [0, 0], [0, 1], [0, 0]]))
    assert not follows_at_once(apart, 3)


def test_each_speed_is_that_at_the_row_of_its_block():
    found = _blocks([True, False, True])
    asked = []
    Rests([found], lambda own, row: asked.append((own, row)) or 0.1 * row)
    assert asked == [(found, 10), (found, 30), (found, 40)]
