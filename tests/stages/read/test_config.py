import numpy as np
import pytest

from besman.exceptions import ConfigError
from besman.io.recordings.formats import write_recording
from besman.pipeline.config import load_pipeline
from besman.records import Recording
from besman.stages.read.config import ReadConfig
from besman.stages.read.read_inputs import read_inputs


def test_what_a_recipe_says_of_its_files(tmp_path):
    positions = np.random.default_rng(0).normal(size=(1, 2, 3)) + np.zeros((20, 1, 1))
    recording = Recording(np.arange(20) / 100, positions, ("a", "b"), 100.0, "a.c3d")
    write_recording(recording, tmp_path / "a.c3d")
    (read,) = read_inputs([str(tmp_path)], config=ReadConfig(up="y")).recordings
    np.testing.assert_allclose(read.positions[..., 2], positions[..., 1], atol=1e-6)
    assert read.origin.up_by == "asked for"


def test_words_that_are_no_units_or_axes():
    from places import TOP

    recipe = TOP / "pipelines" / "ur5_reach.yaml"
    assert load_pipeline(recipe, ("read.up=-z", "read.units=cm")).read == ReadConfig(
        units="cm", up="-z"
    )
    for setting, message in (("read.up=w", "read.up"), ("read.units=km", "read.units")):
        with pytest.raises(ConfigError, match=message):
            load_pipeline(recipe, (setting,))
