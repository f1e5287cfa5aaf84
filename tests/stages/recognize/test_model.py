import dataclasses

import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording, Segments
from besman.stages.recognize.model import (
    Examples,
    Recipe,
    classify_features,
    fit_model,
    name_segments,
)
from besman.stages.recognize.stage import CONFIGS, RecognizeConfig

RECIPE = Recipe(("speeds",), ("hand_top",), (), 4)
METHODS = {"nearest_neighbour": "sklearn", "dtw": "tslearn", "hmm": "hmmlearn", "lstm": "torch"}


def fit(values, labels, method="nearest_neighbour", factor=None, **settings):
    n = len(labels)
    examples = Examples(tuple(labels), ("a.tsv",) * n, np.zeros((n, 2), dtype=int))
    return fit_model(np.asarray(values, dtype=float), examples, RECIPE, method, settings, factor)


def ramps(*levels):
    return np.array(levels, dtype=float)[:, np.newaxis, np.newaxis] + np.zeros((1, 4, 1))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_names_and_is_unsure_and_knows_what_it_does_not_know(method):
    pytest.importorskip(METHODS[method])
    settings = {"n_cells": 4} if method == "lstm" else {}
    model = fit(ramps(0, 0.1, 1, 1.1), "aabb", method, 2.0, **settings)
    labels, uncertainty = classify_features(model, ramps(0.05, 1.05, 30))
    assert labels == ("a", "b", "unknown")
    assert np.isfinite(uncertainty).all()
    assert uncertainty.shape == (3,)
    assert classify_features(model, np.empty((0, 4, 1)))[0] == ()


@pytest.mark.parametrize("method", METHODS)
def test_one_example_only_is_enough(method):
    pytest.importorskip(METHODS[method])
    settings = {"n_cells": 4, "max_epochs": 3} if method == "lstm" else {}
    model = fit(ramps(1), "a", method, 2.0, **settings)
    assert classify_features(model, ramps(0, 5))[0] == ("a", "a")


@pytest.mark.parametrize("method", METHODS)
def test_features_that_are_not_numbers_are_refused(method):
    pytest.importorskip(METHODS[method])
    settings = {"n_cells": 4, "max_epochs": 3} if method == "lstm" else {}
    values = ramps(0, 1)
    model = fit(values, "ab", method, **settings)
    values[1, 2] = np.nan
    with pytest.raises(RecognitionError, match="must be finite, got NaN"):
        classify_features(model, values)
    with pytest.raises(RecognitionError, match="features of example 1 must be finite, got NaN"):
        fit(values, "ab", method, **settings)


def test_neighbours_vote():
    model = fit(ramps(0, 0.1, 0.2, 0.3), "abba", n_neighbors=3)
    assert classify_features(model, ramps(0.0))[0] == ("b",)
    with pytest.raises(RecognitionError, match="n_neighbors: got 3, expected at most the number"):
        fit(ramps(0, 1), "ab", n_neighbors=3)


def test_a_model_that_does_not_fit_is_refused():
    model = fit(ramps(0, 1), "ab")
    with pytest.raises(RecognitionError, match="model 'nearest_neighbour': got 2 examples of 4"):
        dataclasses.replace(model, labels=("a", "b", "c"))
    with pytest.raises(RecognitionError, match="a method of nearest_neighbour, dtw, hmm, lstm"):
        dataclasses.replace(model, method="magic")


def hide(recording, marker, rows):
    positions = recording.positions.copy()
    positions[rows, recording.markers.index(marker)] = np.nan
    return dataclasses.replace(recording, positions=positions)


def test_a_gap_of_an_object_falls_back_on_the_person(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    assert model.recipe.objects == ("box_back",)
    start, _ = truth[0].bounds[1]
    hidden = hide(recordings[0], "box_back", slice(start, start + 3))
    labels, uncertainty = name_segments(model, hidden, truth[0].bounds)
    assert labels == truth[0].labels
    seen, _ = name_segments(model, recordings[0], truth[0].bounds)
    assert seen == labels
    assert np.isfinite(uncertainty).all()
    keep = [k for k, name in enumerate(hidden.markers) if name != "box_back"]
    without = LabelledRecording(
        hidden.time,
        hidden.positions[:, keep],
        tuple(hidden.markers[k] for k in keep),
        hidden.filled[:, keep],
        50.0,
        "a.tsv",
    )
    assert name_segments(model, without, truth[0].bounds)[0] == truth[0].labels


def test_a_gap_of_the_person_is_refused(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    hidden = hide(recordings[0], "elbow", slice(3, 5))
    with pytest.raises(RecognitionError, match=r"0.tsv: marker 'elbow' was not seen in frame 4"):
        name_segments(model, hidden, truth[0].bounds)


def test_a_class_that_was_not_learnt_is_unknown(one_arm, make_person):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    names = list(recordings[0].markers)
    moves = {"wild": (-1.5, 0.8, 0.9)}
    stranger, manual = make_person("c.tsv", 9, names, ("hand_top", "hand_left"), 3, moves)
    assert set(name_segments(model, stranger, manual.bounds)[0]) == {"unknown"}
    free = RecognizeConfig(unknown_factor=None).train(recordings, truth)
    assert "unknown" not in name_segments(free, stranger, manual.bounds)[0]


def test_segments_of_two_samples_are_named_and_of_one_refused(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    stage = RecognizeConfig()
    short = Segments(np.array([[0, 2]]), 0.0, 50.0, "0.tsv")
    assert len(stage.run(recordings[:1], (short,), model)[0].labels) == 1
    with pytest.raises(RecognitionError, match=r"got segment \[4, 5\); expected at least 2"):
        name_segments(model, recordings[0], [[4, 5]])


@pytest.mark.parametrize("method", METHODS)
def test_every_stage_learns_and_names(method, one_arm):
    pytest.importorskip(METHODS[method])
    recordings, truth = one_arm
    stage = CONFIGS[method](n_points="mean")
    model = stage.train(recordings, truth)
    assert 40 < model.recipe.n_points < 60
    found = stage.run(recordings, truth, model)
    right = [
        a == b
        for one, t in zip(found, truth, strict=True)
        for a, b in zip(one.labels, t.labels, strict=True)
    ]
    assert np.mean(right) > (0.8 if method == "hmm" else 0.9)


def test_one_example_of_each_class_and_all_alike_are_enough(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig(examples_per_class=1).train(recordings, truth)
    assert len(model.labels) == 4
    assert set(name_segments(model, recordings[0], truth[0].bounds)[0]) <= {
        *model.labels,
        "unknown",
    }
    same = fit(ramps(0, 0, 1, 1), "aabb", factor=1.0)
    assert classify_features(same, ramps(0.0, 1.0, 9.0))[0] == ("a", "b", "unknown")


def test_examples_of_two_samples_are_learnt_and_of_one_refused(one_arm):
    recordings, truth = one_arm
    bounds = np.array([[0, 2], [100, 102]])
    short = dataclasses.replace(
        truth[0], bounds=bounds, labels=("forward", "up"), distances=np.zeros(2)
    )
    model = RecognizeConfig(idle_s=1e5).train(recordings[:1], (short,))
    assert name_segments(model, recordings[0], bounds)[0] == ("forward", "up")
    shorter = dataclasses.replace(short, bounds=np.array([[0, 1], [100, 102]]))
    with pytest.raises(RecognitionError, match=r"0.tsv: got segment \[0, 1\); expected at least 2"):
        RecognizeConfig(idle_s=1e5).train(recordings[:1], (shorter,))


def test_an_example_with_a_gap_is_refused(one_arm):
    recordings, truth = one_arm
    hidden = hide(recordings[0], "elbow", slice(0, None))
    with pytest.raises(RecognitionError, match=r"0.tsv: marker 'elbow' was not seen in frame 1"):
        RecognizeConfig().train((hidden,), truth[:1])


def test_a_marker_that_a_feature_needs_is_missed(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    for name, message in (
        ("hand_left", "0.tsv: hand_orientation needs hand_top's orientation or three markers"),
        ("elbow", "0.tsv: no arm is complete: got back_top"),
        ("back_left", "0.tsv: no marker 'back_left': the person's frame needs back_top"),
    ):
        keep = [k for k, marker in enumerate(recordings[0].markers) if marker != name]
        less = dataclasses.replace(
            recordings[0],
            positions=recordings[0].positions[:, keep],
            markers=tuple(recordings[0].markers[k] for k in keep),
            filled=recordings[0].filled[:, keep],
        )
        with pytest.raises(RecognitionError, match=message):
            name_segments(model, less, truth[0].bounds)
