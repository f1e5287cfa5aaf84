"""A model is changed in one place at a time: each change is refused, and says what is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.stages.recognize.model_check import check_model
from besman.stages.recognize.stage import CONFIGS


@pytest.fixture(scope="module")
def models(one_arm):
    pytest.importorskip("hmmlearn")
    return {method: CONFIGS[method]().train(*one_arm) for method in ("nearest_neighbour", "hmm")}


def test_what_was_learnt_passes(models):
    for model in models.values():
        check_model(model)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: {"sources": m.sources[:-1]}, "labels, .* sources and .* bounds; expected one"),
        (lambda m: {"bounds": m.bounds[:, ::-1]}, "bounds: expected half-open rows"),
        (lambda m: {"spread": 0 * m.spread}, "spread: expected more than 0 of every channel"),
        (lambda m: {"threshold": -1.0}, "threshold: got -1, expected 0 or more"),
        (lambda m: {"settings": {"n_neigbors": 1}}, "no setting 'n_neigbors'; did you mean 'n_ne"),
        (lambda m: {"settings": {"n_neighbors": 0}}, "n_neighbors: got 0, expected 1 to"),
        (lambda m: {"settings": {"n_neighbors": 1.5}}, "n_neighbors: got 1.5, expected 1 to"),
        (
            lambda m: {"settings": {"n_neighbors": 99}},
            "expected at most the number of examples",
        ),
        (
            lambda m: {"recipe": replace(m.recipe, features=("speds", *m.recipe.features[1:]))},
            "no feature 'speds'; did you mean 'speeds'",
        ),
        (lambda m: {"recipe": replace(m.recipe, features=("speeds",))}, "channels, expected"),
        (lambda m: {"parameters": {"means_0": np.zeros(1)}}, "'means_0' is missing or unknown"),
        (lambda m: {"fallback": m}, "fallback: expected the same without features of objects"),
    ],
)
def test_a_part_that_does_not_fit_is_named(models, change, message):
    model = models["nearest_neighbour"]
    with pytest.raises(RecognitionError, match=message):
        check_model(replace(model, **change(model)))


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("transmat_0", lambda value: 2 * value, "transmat_0: expected rows that sum to 1"),
        ("startprob_1", lambda value: -value, "startprob_1: expected rows that sum to 1"),
        ("covars_0", lambda value: -value, "covars_0: expected variances above 0"),
        ("means_0", lambda value: value[:, :-1], "means_0: expected finite numbers of shape"),
        ("means_0", lambda value: value * np.nan, "means_0: expected finite numbers of shape"),
    ],
)
def test_what_no_markov_model_learns_is_named(models, name, change, message):
    model = models["hmm"]
    parameters = {**model.parameters, name: change(model.parameters[name])}
    with pytest.raises(RecognitionError, match=message):
        check_model(replace(model, parameters=parameters))
