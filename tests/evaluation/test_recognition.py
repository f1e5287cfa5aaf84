import json

import numpy as np
import pytest

from besman.evaluation.draws import draw_balanced, draw_subjects
from besman.evaluation.recognition import check_methods, recognition_table, run_recognition
from besman.evaluation.recognition_data import LabelledSet, load_sets, name_parts, simulate_sets
from besman.evaluation.recognition_figures import write_recognition_figures
from besman.exceptions import ConfigError, RecognitionError
from besman.records import Recording
from besman.stages.recognize.model import Recipe

RECIPE = Recipe(("positions", "log_object_speed"), ("hand_top",), ("box_back",), 5)


@pytest.fixture
def toy():
    rng = np.random.default_rng(0)
    labels = np.array(["a", "b", "c"] * 14)
    values = rng.normal(scale=0.05, size=(42, 5, 4))
    values[:, :, 0] += np.array([0, 1, 2] * 14)[:, np.newaxis]
    subjects = np.array(["subject1"] * 21 + ["subject2"] * 21)
    return LabelledSet("toy", "synthetic", RECIPE, values, labels, subjects, 0.0)


def test_draws_take_as_many_of_each_class_and_leave_small_ones_out(toy):
    labels = np.append(toy.labels, ["rare"] * 3)
    draw = draw_balanced(labels, 3, 5)
    assert sorted(labels[draw.learn]) == ["a"] * 3 + ["b"] * 3 + ["c"] * 3
    assert "rare" not in labels[draw.test]
    assert not set(draw.learn) & set(draw.test)
    again = draw_balanced(labels, 3, 5)
    np.testing.assert_array_equal(draw.learn, again.learn)


def test_a_subject_left_out_teaches_nothing(toy):
    draw = draw_subjects(toy, 2, "subject2", 0)
    assert set(toy.subjects[draw.learn]) == {"subject1"}
    assert set(toy.subjects[draw.test]) == {"subject2"}
    assert len(draw.learn) == 6


def test_experiments_give_rows_and_figures(toy, tmp_path):
    shares = []
    result = run_recognition([toy], ["nearest_neighbour"], 3, shares.append)
    json.dumps(result)
    kinds = {row["experiment"] for row in result["rows"]}
    assert kinds == {"examples", "settings", "subjects", "unknown"}
    assert {row["object_features"] for row in result["rows"]} == {True, False}
    assert all(row["source"] == "synthetic" for row in result["rows"])
    plain = [r for r in result["rows"] if not r["object_features"] and "accuracy" in r]
    assert all(r["accuracy"] == 1.0 for r in plain if r["experiment"] == "examples")
    assert [r["examples_per_class"] for r in plain if r["experiment"] == "examples"][-1] == 10
    unknown = [r for r in result["rows"] if r["experiment"] == "unknown"]
    assert [(r["examples_per_class"], r["new_subject"]) for r in unknown[:3]] == [
        (5, False),
        (10, False),
        (5, True),
    ]
    assert all(r["known_rejected_share"] < 0.1 for r in unknown)
    assert all(r["novel_found_share"] > 0.9 for r in unknown if not r["object_features"])
    assert shares == [0.5, 1.0]
    assert recognition_table(result).row_count == len(result["rows"])
    paths = write_recognition_figures(result, [toy], tmp_path / "figures")
    assert [path.name for path in paths] == [
        "toy_examples.svg",
        "toy_subjects.svg",
        "toy_settings.svg",
        "toy_map.svg",
    ]
    assert all("<svg" in path.read_text() for path in paths)


@pytest.mark.parametrize("method", ["dtw", "hmm", "lstm"])
def test_other_methods_are_measured_too(toy, method):
    pytest.importorskip({"dtw": "tslearn", "hmm": "hmmlearn", "lstm": "torch"}[method])
    rows = run_recognition([toy.without_objects()], [method], 1)["rows"]
    best = max(row["accuracy"] for row in rows)
    assert best > 0.9
    assert all(row["train_s"] >= 0 and row["predict_s"] > 0 for row in rows)


def test_the_embedded_sample_is_synthetic():
    from besman.config.resources import resource_folder

    (one,) = load_sets(resource_folder("data") / "stick_throw")
    assert (one.name, one.source) == ("stick_throw", "synthetic")
    assert {"throw", "idle"} <= set(one.labels)
    assert set(one.subjects) == {"subject1", "subject2"}
    assert one.values.shape[:2] == (len(one.labels), 25)


def test_datasets_are_simulated_gestures_in_a_suit_included():
    shares = []
    throws, gestures = simulate_sets(["ball_throw", "gestures"], 2, 1, progress=shares.append)
    assert {throws.source, gestures.source} == {"synthetic"}
    assert "idle" in throws.labels
    # As in the thesis: eleven classes, each once by each of two people, no rest.
    assert len(gestures.labels) == 22
    assert len(set(gestures.labels)) == 11
    assert set(gestures.subjects) == {"subject1", "subject2"}
    assert gestures.recipe.markers[0] == "right_hand"
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_dataset_that_is_not_there_is_refused():
    with pytest.raises(ConfigError, match="--dataset: no dataset 'gesture'; did you mean 'gestu"):
        simulate_sets(["gesture"])


def test_data_and_dataset_exclude_each_other(tmp_path):
    from typer.testing import CliRunner

    from besman.cli.main import app

    options = ["evaluate", "recognition", "--data", str(tmp_path), "--dataset", "gestures"]
    outcome = CliRunner().invoke(app, options)
    assert "--data and --dataset: got both; expected one of them" in str(outcome.exception)


def test_a_folder_without_labels_is_refused(tmp_path):
    from besman.config.resources import resource_folder

    source = resource_folder("data") / "stick_throw" / "subject1.tsv"
    (tmp_path / "a.tsv").write_bytes(source.read_bytes())
    with pytest.raises(RecognitionError, match="no labelled segments; expected segments files"):
        load_sets(tmp_path)


def test_an_unknown_method_is_refused():
    with pytest.raises(ConfigError, match="--method: no method 'knn'; allowed: dtw, hmm, lstm"):
        check_methods(["knn"])
    assert "nearest_neighbour" in check_methods(None)


def test_names_become_those_of_markers():
    names = ("Hand top", "RightForeArm", "T8", "left_elbow")
    quaternions = np.tile([1.0, 0, 0, 0], (3, 4, 1))
    raw = Recording(
        np.arange(3.0), np.zeros((3, 4, 3)), names, 1.0, "a.mvnx", orientations=quaternions
    )
    named = name_parts(raw)
    assert named.markers == ("hand_top", "right_fore_arm", "t8", "left_elbow")
    assert named.orientations.shape == (3, 4, 4)
    bare = Recording(np.arange(3.0), np.zeros((3, 2, 3)), ("a", None), 1.0, "b.tsv")
    with pytest.raises(RecognitionError, match=r"b.tsv: trajectory 2 has no name"):
        name_parts(bare)
