import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import ConfigError, RecordingError
from besman.io.recordings import find_recordings, read_recording
from besman.io.segments_json import find_segments, read_segments, read_throws
from besman.synthetic.datasets import write_synthetic
from besman.synthetic.stick_throw import generate

DATA = Path(__file__).parents[2] / "data"


def test_the_embedded_sample_is_what_the_generator_writes(tmp_path):
    write_synthetic("stick_throw", tmp_path, 2, 8, 100)
    embedded = sorted((DATA / "stick_throw").iterdir())
    made = {path.name for path in tmp_path.iterdir() if path.suffix != ".npz"}
    assert {path.name for path in embedded} == made
    for path in embedded:
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name
    assert sum(path.stat().st_size for path in embedded) < 5e6


def test_checksums_of_the_embedded_sample():
    listed = dict(re.findall(r"\| ([0-9a-f]{64}) \| (\S+) \|", (DATA / "SOURCES.md").read_text()))
    found = {
        hashlib.sha256(path.read_bytes()).hexdigest(): f"stick_throw/{path.name}"
        for path in (DATA / "stick_throw").iterdir()
    }
    assert listed == found


def test_files_say_what_was_simulated(tmp_path):
    paths = write_synthetic("stick_throw", tmp_path / "new", 2, 1, 200, 7)
    assert find_recordings([tmp_path / "new"]) == paths
    for path, capture in zip(paths, generate(2, 1, 200, 7), strict=True):
        recording = read_recording(path)
        np.testing.assert_allclose(
            recording.positions, capture.recording.positions, atol=0.6e-6, rtol=0
        )
        np.testing.assert_array_equal(recording.time, capture.recording.time)
        truth = find_segments(path)
        assert truth is not None
        segments = read_segments(truth, recording)
        np.testing.assert_array_equal(segments.bounds, capture.segments.bounds)
        assert segments.labels == capture.segments.labels
        assert read_throws(truth) == capture.throws


def test_nothing_is_overwritten(tmp_path):
    kept = tmp_path / "subject1_manually_segmented.json"
    kept.write_text("mine")
    with pytest.raises(RecordingError, match="json: is there already and is not overwritten"):
        write_synthetic("stick_throw", tmp_path, 1, 1)
    assert kept.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [kept]


def test_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be written"):
        write_synthetic("stick_throw", tmp_path / "file" / "below", 1, 1)


def test_unknown_dataset(tmp_path):
    with pytest.raises(ConfigError, match="synth: no dataset 'stick_thro'; did you mean 'stick_t"):
        write_synthetic("stick_thro", tmp_path)
