"""Two layers of truth: from what `besman synth` writes to trained blocks and actions."""

import dataclasses
import json

import numpy as np
import pytest

from besman.cli.main import main
from besman.exceptions import ConfigError, RecognitionError
from besman.io.segments_json import segments_path
from besman.person.marker_set import load_marker_set
from besman.pipeline.check import check_pipeline
from besman.records.files import digest
from besman.stages.compose.stage import ComposeConfig, leave_out_actions
from besman.stages.label.stage import LabelConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.model_files import load_model
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.stage import ValleyVmciConfig
from besman.standalone.train_files import train_files
from besman.synthetic.datasets import captures, write_synthetic

STEPS = ("step_up", "step_down")


def label(inputs, markers="right_arm"):
    return LabelConfig(markers=markers).run(inputs.recordings, load_marker_set(markers))


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """Stepping, one arm (synthetic)."""
    folder = tmp_path_factory.mktemp("step")
    write_synthetic("step", folder, 2, 4, seed=5)
    return folder


@pytest.fixture(scope="module")
def rotations(tmp_path_factory):
    """A frame turned by two arms (synthetic)."""
    folder = tmp_path_factory.mktemp("rotation")
    write_synthetic("object_rotation", folder, 2, 5, seed=5)
    return folder


def test_written_files_teach_what_the_truth_teaches(steps):
    inputs = read_inputs([str(steps)])
    made = list(captures("step", 2, 4, seed=5))
    recordings, stage = label(inputs), RecognizeConfig()
    compose = ComposeConfig(levels=(STEPS,))
    written, known = inputs.truth, tuple(capture.truth for capture in made)
    assert digest(stage.train(recordings, written)) == digest(stage.train(recordings, known))
    assert digest(compose.train(recordings, written)) == digest(compose.train(recordings, known))
    # The layers as they were simulated, each on its own.
    blocks = tuple(capture.layers["right_hand"] for capture in made)
    actions = tuple(capture.segments for capture in made)
    assert digest(compose.train(recordings, actions)) == digest(compose.train(recordings, known))
    model, alone = stage.train(recordings, written), stage.train(recordings, blocks)
    assert digest(dataclasses.replace(model, data_sha256="")) == digest(
        dataclasses.replace(alone, data_sha256="")
    )
    assert set(model.classes) == {"up", "down", "left", "right", "idle"}


def test_blocks_and_actions_are_found_from_files_alone(steps):
    inputs = read_inputs([str(steps)])
    recordings = label(inputs)
    compose = ComposeConfig(levels=(STEPS,))
    found = compose.run(
        recordings, ValleyVmciConfig().run(recordings), compose.train(recordings, inputs.truth)
    )
    for one, truth in zip(found, inputs.truth, strict=True):
        rows = [row for row, layer in enumerate(truth.layers) if layer == "actions"]
        assert one.levels[0].labels == tuple(truth.labels[row] for row in rows)


def test_the_command_takes_the_blocks_of_the_right_hand(rotations, tmp_path, monkeypatch):
    arguments = ["train", str(rotations), "--markers", "two_arms", "--out", str(tmp_path / "m")]
    monkeypatch.setattr("sys.argv", ["besman", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code
    model = load_model(tmp_path / "m")
    assert {"hold", "re-grasp_up"} <= set(model.classes)
    assert model.recipe.markers == ("hand_top", "elbow", "shoulder")


def test_the_blocks_of_the_left_hand_on_request(rotations, tmp_path):
    setting = "markers=[left_hand_top, left_elbow, left_shoulder]"
    train_files([rotations], tmp_path / "m", "two_arms", (setting,))
    model = load_model(tmp_path / "m")
    inputs = read_inputs([str(rotations)])
    spans = {
        (truth.source, int(start), int(end))
        for truth in inputs.truth
        for (start, end), layer in zip(truth.bounds, truth.layers, strict=True)
        if layer == "left_hand"
    }
    learnt = {
        (source, int(start), int(end))
        for source, (start, end) in zip(model.sources, model.bounds, strict=True)
    }
    assert learnt <= spans


def test_idle_is_an_action_between_actions(rotations):
    inputs = read_inputs([str(rotations)])
    recordings = label(inputs, "two_arms")
    names = ("lift", "turn_clockwise", "turn_counterclockwise", "place", "idle")
    arms = load_marker_set("two_arms")
    compose = ComposeConfig(levels=(names,), markers=arms.arms, hands=arms.hands)
    models = compose.train(recordings, inputs.truth)
    found = compose.run(recordings, ValleyVmciConfig().run(recordings), models)
    truth = sum(layer == "actions" for one in inputs.truth for layer in one.layers)
    composed = [name for one in found for name in one.levels[0].labels if name != "idle"]
    assert len(composed) == pytest.approx(truth, abs=2)


def test_what_is_no_building_block_is_left_out(rotations):
    truth = read_inputs([str(rotations)]).truth
    compose = ComposeConfig(levels=(("lift", "turn_clockwise"),))
    for side in ("right", "left"):
        for one, blocks in zip(truth, leave_out_actions(truth, compose, side), strict=True):
            rows = [row for row, layer in enumerate(one.layers) if layer == f"{side}_hand"]
            np.testing.assert_array_equal(blocks.bounds, one.bounds[rows])


def test_actions_alone_teach_no_blocks(steps, tmp_path):
    path = steps / "subject1.tsv"
    rows = json.loads(segments_path(path).read_text())["segments"]
    (tmp_path / path.name).write_bytes(path.read_bytes())
    some = [row for row in rows if row["layer"] == "actions"]
    segments_path(tmp_path / path.name).write_text(json.dumps(some))
    with pytest.raises(RecognitionError, match=r"in the layer of the arm .*\(right_hand, left_han"):
        train_files([tmp_path / path.name], tmp_path / "m", "right_arm", ())
    settings = ("label.method=named", "label.learn_from=null", f"recordings={tmp_path}")
    with pytest.raises(RecognitionError, match="no labelled examples"):
        check_pipeline("ur5_reach", (settings[2], "select.label=up"))


def test_check_counts_blocks_or_actions(steps):
    recordings = f"recordings={steps}"
    with pytest.raises(ConfigError, match=r"select.label: got 'step_up', which has no labelled"):
        check_pipeline("ur5_reach", (recordings, "select.label=step_up"))
    lines = check_pipeline("ur5_reach", (recordings, "select.label=up"))
    assert any("up 16" in line and "step_up" not in line for line in lines)
    compose = "compose={levels: [[step_up, step_down]]}"
    action = ("select.label=null", "select.action=step_up")
    lines = check_pipeline("ur5_reach", (recordings, compose, *action))
    assert any("step_up 8" in line for line in lines)
