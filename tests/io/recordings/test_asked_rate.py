"""A rate that the user says: of files that have none, and of any other."""

import json
import sys

import numpy as np
import pytest
from foreign_recordings import WRITERS

from besman.cli import main as command_line
from besman.exceptions import ConfigError, RecordingError
from besman.io.recordings.format import parse_rate, reading, reading_options
from besman.io.recordings.formats import FORMATS, read_recording
from besman.pipeline.config import load_pipeline
from besman.records import Recording
from besman.stages.read.config import ReadConfig
from besman.stages.read.read_inputs import read_inputs

CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
FRAMES = [{"Nose": [0.1 * at, 0, 1.7], "RAnkle": [0.1, 0.2, 0.1]} for at in range(12)]


@pytest.fixture
def rateless(tmp_path):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(FRAMES))
    return path


@CONCLUDING
def test_of_a_file_without_one(rateless):
    with pytest.raises(RecordingError, match=r"say it with --rate, in a recipe with read\.rate_hz"):
        read_recording(rateless, units="m")
    read = read_recording(rateless, units="m", rate_hz=25.0)
    np.testing.assert_allclose(read.time, np.arange(12) / 25)
    assert read.rate_hz == 25.0
    (again,) = read_inputs([str(rateless)], config=ReadConfig(rate_hz=25.0, units="m")).recordings
    np.testing.assert_array_equal(again.time, read.time)
    with reading(rate_hz=25.0, subject="Ann", topics=("/a", "/b")):
        assert reading_options() == ["--rate", "25", "--subject", "Ann", "--topic", "/a,/b"]
    with reading(rate_hz=25.0):
        assert read_recording(rateless, units="m").rate_hz == 25.0


@CONCLUDING
@pytest.mark.parametrize("entry", [one for one in FORMATS if one.name in WRITERS or one.writer])
def test_counts_more_than_the_file_s(tmp_path, entry):
    time = np.arange(40) / 50
    heights = np.array([1.7, 1.4, 0.9, 0.05])
    positions = np.zeros((40, 4, 3)) + 0.01
    positions[..., 2] = heights
    positions[..., 0] += 0.1 * np.sin(5 * time)[:, None]
    names = ("nose", "neck", "hip", "ankle")
    written = Recording(time, positions, names, 50.0, "a", first_frame=1)
    path = tmp_path / "a"
    (WRITERS.get(entry.name) or entry.write)(written, path)
    read = read_recording(path, rate_hz=125.0)
    assert read.rate_hz == 125.0
    np.testing.assert_allclose(np.diff(read.time), 1 / 125, atol=1e-9)


def test_what_is_no_rate():
    recipe = "ur5_reach"
    for text in ("0", "-3", "fast", "1e9"):
        with pytest.raises(RecordingError, match=f"--rate: got '{text}'; expected 1 to 10000 Hz"):
            parse_rate(text)
    assert parse_rate(None) is None
    from besman.config.resources import find_resource

    with pytest.raises(ConfigError, match="rate_hz"):
        load_pipeline(find_resource("pipelines", recipe, ".yaml"), ("read.rate_hz=0",))


@CONCLUDING
def test_on_the_command_line(rateless, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["besman", "look", "--rate", "25", str(rateless)])
    with pytest.raises(SystemExit) as left:
        command_line.main()
    assert not left.value.code
    said = capsys.readouterr().out
    assert "25 Hz, 12 frames" in said
    assert f"{rateless}" in said.split("how to go on:")[1]
    assert "--rate 25" in said.split("how to go on:")[1]
