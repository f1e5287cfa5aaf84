"""How sure names are, for three fragments whose distances are known."""

import numpy as np
import pytest
from scipy.special import expit

from besman.person.marker_set import MarkerSet
from besman.stages.label.confidence import (
    estimate_confidence,
    measure_margins,
    measure_plausibility,
)
from besman.stages.label.fragments import measure_pairs, split_fragments
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.label.scores import GHOST

PLACES = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.4, 0.0]])


@pytest.fixture(scope="module")
def model():
    names = ("a", "b", "c")
    return model_from_pose(
        MarkerSet(
            name="three",
            markers=dict.fromkeys(names, ()),
            required=names,
            clusters={"all": names},
            pose_m=dict(zip(names, PLACES.tolist(), strict=True)),
        )
    )


def pairs_of(places):
    return measure_pairs(split_fragments(np.tile(places, (50, 1, 1)), 50.0))


def test_distances_of_the_model_are_plausible_and_half_as_long_ones_are_not(model):
    labels = np.arange(3)
    assert measure_plausibility(pairs_of(PLACES), labels, model).tolist() == [1, 1, 1]
    assert measure_plausibility(pairs_of(0.5 * PLACES), labels, model).max() == 0.0
    nameless = np.full(3, GHOST)
    assert measure_plausibility(pairs_of(0.5 * PLACES), nameless, model).tolist() == [1, 1, 1]


def test_margins_are_those_of_trying_every_other_name(model):
    """Another name: its holder takes the one that became free, or none if that is worth more."""
    score = np.random.default_rng(0).uniform(-2, 6, (3, 3)) + 6.0 * np.eye(3)
    labels = np.arange(3)
    expected = []
    for one in range(3):
        rivals = [0.0]
        for name in range(3):
            if name != one:
                given_up = score[name, name] - max(score[name, one], 0.0)
                rivals.append(score[one, name] - given_up)
        expected.append(score[one, one] - max(rivals))
    np.testing.assert_allclose(measure_margins(pairs_of(PLACES), score, labels), expected)


def test_a_ghost_is_as_sure_as_its_best_name_is_bad(model):
    score = np.array([[5.0, -1.0, -1.0], [-1.0, 5.0, -1.0], [-9.0, -9.0, -2.0]])
    margins = measure_margins(pairs_of(PLACES), score, np.array([0, 1, GHOST]))
    assert margins[2] == pytest.approx(2.0)


def test_confidence_is_a_logistic_curve_from_one_half():
    margin = np.array([-3.0, 0.0, 1.0, 10.0])
    expected = expit(0.3 * np.array([0.0, 0.0, 1.0, 10.0]))
    np.testing.assert_allclose(estimate_confidence(margin), expected)
