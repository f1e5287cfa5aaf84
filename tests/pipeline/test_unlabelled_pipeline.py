"""The pipeline up to the names, from unnamed dots of simulated cameras."""

import json

import pytest

from besman.config.resources import find_resource
from besman.exceptions import ConfigError, RecordingError
from besman.io.recordings.true_names import read_true_names
from besman.person.marker_set import load_marker_set
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import learn_from, load_pipeline
from besman.stages.label.results import label_results
from besman.stages.read.read_inputs import read_inputs
from besman.synthetic.cameras import Room
from besman.synthetic.datasets import write_synthetic

STICK_THROW = find_resource("pipelines", "ur5_stick_throw")


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """One person in front of cameras, and another with names to learn from."""
    folder = tmp_path_factory.mktemp("capture")
    write_synthetic("stick_throw", folder / "dots", n_subjects=1, n_repetitions=3, room=Room())
    write_synthetic("stick_throw", folder / "named", n_subjects=1, n_repetitions=1, seed=9)
    return folder


def settings(capture):
    return (
        f"recordings={capture}/dots",
        "label={method: trajectories}",
        f"label.learn_from={capture}/named/subject1.tsv",
        "recognize.examples_per_class=1",
    )


def test_dots_get_their_names(capture):
    config = load_pipeline(STICK_THROW, settings(capture))
    inputs = read_inputs(config.recordings, learn_from(config))
    assert "subject1.tsv" in inputs.checksums
    assert set(inputs.recordings[0].names) == {None}
    marker_set = load_marker_set(config.label.markers)
    labelled = config.label.run(inputs.recordings, marker_set, inputs.teacher)
    results = label_results(inputs.recordings, labelled, marker_set, inputs.names)
    assert results["wrong_share"] == 0.0
    assert results["right_share"] > 0.98
    lines = "\n".join(check_pipeline(str(STICK_THROW), settings(capture)))
    assert "to be named as 9 markers of right_arm" in lines


def test_truth_that_does_not_fit(capture, tmp_path):
    inputs = read_inputs((str(capture / "dots"),))
    path = tmp_path / "x_truth.json"
    path.write_text(json.dumps({"trajectories": ["elbow"]}))
    with pytest.raises(RecordingError, match="trajectories: got 1 names, expected one for each"):
        read_true_names(path, inputs.recordings[0])
    path.write_text("{")
    with pytest.raises(RecordingError, match="cannot be read as JSON"):
        read_true_names(path, inputs.recordings[0])


def test_a_method_that_is_not_there():
    with pytest.raises(ConfigError, match="named"):
        load_pipeline(STICK_THROW, ("label.method=guessed",))
