"""The experiment on tiny demonstrations whose truth is known."""

import dataclasses

import numpy as np
import pytest

from besman.cli import main as cli
from besman.evaluation.demonstrations import (
    arm_markers,
    cut_demonstrations,
    name_markers,
    sample_labels,
)
from besman.evaluation.hierarchy import (
    EXPERIMENTS,
    METHODS,
    evaluate,
    find_blocks,
    hierarchy_table,
    run_experiment,
)
from besman.evaluation.names import HIERARCHY_NAMES
from besman.exceptions import ConfigError, RecognitionError
from besman.records import Recording


@pytest.fixture(scope="module")
def demonstrations(make_steps):
    recording, blocks, actions = make_steps(["step_up", "step_down"] * 6, seed=5)
    return cut_demonstrations(recording, actions, {"right": blocks}, 2)


def test_the_help_names_every_experiment():
    assert tuple(EXPERIMENTS) == HIERARCHY_NAMES


def test_cut_demonstrations(demonstrations):
    assert len(demonstrations) == 6
    for one in demonstrations:
        assert one.actions.labels == ("step_up", "step_down")
        assert len(one.blocks["right"].labels) == 8
        assert one.actions.bounds[0, 0] == 0
        assert one.actions.bounds[-1, 1] == len(one.recording.time)


@pytest.mark.parametrize("method", METHODS)
def test_scores_of_true_blocks_are_perfect(demonstrations, method):
    found = [one.blocks for one in demonstrations]
    score = evaluate(demonstrations, found, 2, method, valleys=False)
    assert (score.n, score.tp, score.fp, score.f1, score.block_f1) == (4, 1, 0, 1.0, 1.0)
    assert score.accuracy == 1.0
    assert score.block_accuracy == 1.0 if method == "vhms" else score.block_accuracy > 0.6


def test_rows(demonstrations):
    rows = run_experiment("step", demonstrations, draws=1)
    assert [row["method"] for row in rows] == [*METHODS, "vhms_valleys"]
    assert all(row["source"] == "synthetic" for row in rows)
    assert rows[-1]["f1"] > 0.9
    assert rows[0]["thesis"] == (0.85, 0.79, 0.77, 0.97)
    assert hierarchy_table(rows).row_count == 4


def test_blocks_are_found_for_each_arm(demonstrations):
    found = find_blocks(demonstrations[0])
    assert set(found) == {"right"}
    assert found["right"].bounds[-1, 1] == len(demonstrations[0].recording.time)


def test_labels_of_samples():
    assert sample_labels([(1, 3)], ["a"], 4) == ["idle", "a", "a", "idle"]


def test_arms_by_their_markers():
    assert arm_markers(["hand_top", "elbow", "shoulder"]) == {
        "right": ("hand_top", "elbow", "shoulder")
    }
    both = [
        f"{side}_{name}" for side in ("left", "right") for name in ("wrist", "elbow", "shoulder")
    ]
    assert arm_markers(both)["left"] == ("left_wrist", "left_elbow", "left_shoulder")


def test_bad_input(demonstrations, monkeypatch, capsys):
    with pytest.raises(RecognitionError, match="no arm is complete"):
        arm_markers(["hand_top", "elbow"])
    with pytest.raises(RecognitionError, match="expected more than the 6 to learn from"):
        evaluate(demonstrations, [one.blocks for one in demonstrations], 6)
    with pytest.raises(ConfigError, match="no dataset 'stepp'; did you mean 'step'"):
        run_experiment("stepp")
    one = demonstrations[0].recording
    unnamed = Recording(one.time, one.positions, (None,) * 6, one.rate_hz, "x.tsv")
    with pytest.raises(RecognitionError, match=r"x\.tsv: trajectory 1 has no name"):
        name_markers(unnamed)
    gap = dataclasses.replace(one, positions=np.full_like(one.positions, np.nan))
    with pytest.raises(Exception, match="was not seen in frame"):
        find_blocks(dataclasses.replace(demonstrations[0], recording=gap))
    monkeypatch.setattr("sys.argv", ["besman", "evaluate", "hierarchy", "stepp"])
    with pytest.raises(SystemExit):
        cli.main()
    assert "did you mean 'step'" in capsys.readouterr().err
