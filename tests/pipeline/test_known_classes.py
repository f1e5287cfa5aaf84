from dataclasses import replace

import pytest

from besman.config.resources import find_resource, resource_folder
from besman.exceptions import ConfigError, RecognitionError
from besman.pipeline.config import learn_from, load_pipeline
from besman.pipeline.known_classes import count_examples, count_model, list_counts
from besman.pipeline.learning import find_examples, read_examples
from besman.stages.read.read_inputs import read_inputs
from besman.standalone.train_files import train_files

STICK_THROW = find_resource("pipelines", "ur5_stick_throw")
SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


@pytest.fixture(scope="module")
def read():
    config = load_pipeline(STICK_THROW)
    return read_inputs([str(SAMPLE)], learn_from(config), config.read)


def test_examples_are_counted_and_a_class_without_is_refused(read):
    counts = count_examples(load_pipeline(STICK_THROW), read)
    (manual,) = read.truth
    throws = manual.labels.count("throw")
    assert counts["throw"] == throws
    assert f"throw {throws}" in list_counts(counts)
    asked = load_pipeline(STICK_THROW, ("select.label=swing",))
    with pytest.raises(ConfigError, match=r"select\.label: got 'swing', which has no labelled ex"):
        count_examples(asked, read)
    with pytest.raises(RecognitionError, match="no labelled examples: none of 1 recordings has"):
        count_examples(asked, replace(read, truth=(None,)))


def test_a_class_that_a_model_has_not_is_refused(tmp_path):
    model = train_files([SAMPLE], tmp_path / "m", "right_arm", ())[0]
    given = (f"recognize.model={model.parent / 'm'}", "recognize.classes=null")
    assert count_model(load_pipeline(STICK_THROW, given))["throw"] > 0
    with pytest.raises(ConfigError, match=r"select\.label: got 'swing', which is no class of "):
        count_model(load_pipeline(STICK_THROW, (*given, "select.label=swing")))


def test_examples_are_read_only_where_there_is_something_to_learn(read, tmp_path):
    config = load_pipeline(STICK_THROW)
    assert read_examples(config, read, None) is read
    assert read_examples(config, read, tmp_path) is None
    with pytest.raises(ConfigError, match=r"select\.label: got 'swing'"):
        read_examples(load_pipeline(STICK_THROW, ("select.label=swing",)), read, None)
    # Labelled recordings are handed on, with the manual segments of those that have some.
    labelled = ("labelled",)
    assert find_examples(config, None, read, None, labelled) == ((), ())
    assert find_examples(config, None, read, read, labelled) == (labelled, read.truth)
    left = replace(read, recordings=read.recordings * 2, truth=(*read.truth, None))
    assert find_examples(config, None, left, read, labelled) == (labelled, read.truth)
