import hashlib
import json
import re

import numpy as np
import pytest
from places import DATA
from typer.testing import CliRunner

from besman.cli.main import app
from besman.exceptions import ConfigError, RecordingError
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.io.segments_json import find_segments, read_segments, read_throws
from besman.records.layers import LAYERS
from besman.synthetic.cameras import Room
from besman.synthetic.capture import truth_path
from besman.synthetic.datasets import DATASETS, captures, write_synthetic
from besman.synthetic.names import DATASET_NOTES
from besman.synthetic.stick_throw import generate_stick_throws


@pytest.mark.parametrize("folder", ["stick_throw", "stick_throw_unlabelled"])
def test_the_embedded_sample_is_what_the_generator_writes(tmp_path, folder):
    room = Room() if folder.endswith("unlabelled") else None
    write_synthetic("stick_throw", tmp_path, 2, 8, 100, room=room)
    embedded = sorted((DATA / folder).iterdir())
    made = {path.name for path in tmp_path.iterdir() if path.suffix != ".npz"}
    assert {path.name for path in embedded} == made
    for path in embedded:
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


def test_the_calibration_is_what_the_generator_writes(tmp_path):
    write_synthetic("stick_throw", tmp_path, 1, 1, 100, 77)
    embedded = DATA / "stick_throw_calibration" / "person.tsv"
    assert embedded.read_bytes() == (tmp_path / "subject1.tsv").read_bytes()


@pytest.mark.parametrize(
    ("folder", "dataset", "counts", "seed"),
    [
        ("ball_throw", "ball_throw", (1, 8), 9),
        ("lever", "lever", (2, 3), 9),
        ("pick_and_place_unlabelled", "pick_and_place", (3, 1), 3),
    ],
)
def test_samples_of_the_tasks_are_what_the_generator_writes(
    tmp_path, folder, dataset, counts, seed
):
    write_synthetic(dataset, tmp_path, *counts, 60, seed, Room())
    files = sorted((DATA / folder).iterdir())
    assert sum(path.stat().st_size for path in files) < 1e6
    for path in files:
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


def test_the_person_with_a_box_is_what_the_generator_writes(tmp_path):
    write_synthetic("pick_and_place", tmp_path, 1, 1, 60, 77)
    embedded = DATA / "pick_and_place_calibration" / "person.tsv"
    assert embedded.read_bytes() == (tmp_path / "subject1.tsv").read_bytes()


def test_checksums_of_the_embedded_sample():
    rows = re.findall(r"\| ([0-9a-f]{64}) \| (\S+) \|", (DATA / "SOURCES.md").read_text())
    files = [path for path in DATA.glob("*/*") if path.is_file()]
    assert {name: checksum for checksum, name in rows} == {
        path.relative_to(DATA).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }
    sample = [path for path in files if path.parent.name == "stick_throw_unlabelled"]
    assert sum(path.stat().st_size for path in sample) < 5e6


def test_files_say_what_was_simulated(tmp_path):
    paths = write_synthetic("stick_throw", tmp_path / "new", 2, 1, 200, 7)
    assert find_recordings([tmp_path / "new"]) == paths
    for path, capture in zip(paths, generate_stick_throws(2, 1, 200, 7), strict=True):
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


THESIS = {
    "step": (6, 171),
    "lever": (2, 68),
    "pick_and_place": (3, 18),
    "ball_throw": (10, 240),
    "stick_throw": (7, 697),
    "stick_throw_unmarked": (7, 697),
    "stick_throw_marked": (3, 34),
    "object_rotation": (3, 33),
}


def test_counts_of_the_thesis():
    for name, (subjects, repetitions) in THESIS.items():
        assert (len(DATASETS[name].repetitions), sum(DATASETS[name].repetitions)) == (
            subjects,
            repetitions,
        )
    gestures = DATASETS["gestures"]
    assert len(gestures.planners) * sum(gestures.repetitions) // 11 * 11 == 1045
    assert len(gestures.repetitions) == 6
    assert len(gestures.classes) == 11


def test_the_help_names_every_dataset():
    assert tuple(DATASET_NOTES) == tuple(DATASETS)
    told = CliRunner().invoke(app, ["synth", "--help"], env={"COLUMNS": "1000"}).output
    for name, note in DATASET_NOTES.items():
        assert (f"{name} ({note})" if note else name) in told


@pytest.mark.parametrize("name", sorted(DATASETS))
def test_every_dataset_says_what_happens_when(name):
    for capture in captures(name, 2, 2, seed=4):
        time, segments = capture.recording.time, capture.segments
        allowed = {*DATASETS[name].classes, "idle"}
        whole = [label for label in segments.labels if not label.endswith("_part")]
        if name == "step":
            allowed = {"step_up", "step_down"}
        assert set(whole) <= allowed
        assert (segments.bounds[:, 0] < segments.bounds[:, 1]).all()
        assert segments.bounds.max() < len(time)
        kept = segments.bounds[[not label.endswith("_part") for label in segments.labels]]
        assert (kept[1:, 0] >= kept[:-1, 1]).all()
        assert capture.body is not None
        for pose in capture.body.hands.values():
            assert pose.shape == (len(time), 7)
            np.testing.assert_allclose(np.linalg.norm(pose[:, 3:], axis=1), 1)
            speed = np.linalg.norm(np.diff(pose[:, :3], axis=0), axis=1) * capture.recording.rate_hz
            assert speed.max() < 5
            for (start, end), label in zip(segments.bounds, segments.labels, strict=True):
                if label == "idle":
                    assert speed[start + 3 : end - 3].max() < 0.4
        for layer in capture.layers.values():
            np.testing.assert_array_equal(layer.bounds[1:, 0], layer.bounds[:-1, 1])


@pytest.mark.parametrize("name", ["lever", "gestures", "object_rotation", "rotation"])
def test_a_person_does_not_depend_on_the_others(name):
    one = list(captures(name, 1, 1, seed=9))
    more = list(captures(name, 2, 2, seed=9))[: len(one)]
    for first, second in zip(one, more, strict=True):
        side = "right"
        rows = int(first.segments.bounds[-1, 0])
        np.testing.assert_allclose(
            first.body.hands[side][:rows], second.body.hands[side][:rows], atol=0.06
        )


def test_every_class_of_blocks_occurs():
    found = set()
    for capture in captures("object_rotation", 1, 5):
        for layer in capture.layers.values():
            found |= set(layer.labels)
    turns = {"turn_clockwise", "turn_counterclockwise", "re-grasp_down", "re-grasp_up"}
    assert found == turns | {"lift", "hold", "place", "idle"}


def test_hesitation_splits_a_movement():
    labels = [label for c in captures("pick_and_place", 6, 6) for label in c.segments.labels]
    assert {label for label in labels if label.endswith("_part")} == {
        "approach_forward_part",
        "approach_right_part",
    }


def test_formats_can_be_read_back(tmp_path):
    for name in ("gestures", "circle_drawing", "pick_and_place"):
        made = {capture.recording.source: capture for capture in captures(name, 1, 1)}
        for path in write_synthetic(name, tmp_path / name, 1, 1):
            recording, expected = read_recording(path), made[path.name].recording
            np.testing.assert_allclose(recording.positions, expected.positions, atol=1e-6)
            assert recording.names == expected.names


def test_truth_of_unnamed_trajectories_is_written(tmp_path):
    shares = []
    (path,) = write_synthetic(
        "object_rotation", tmp_path, 1, 1, room=Room(), progress=shares.append
    )
    truth = json.loads(truth_path(path).read_text())
    recording = read_recording(path)
    assert len(truth["trajectories"]) == len(recording.names)
    assert set(recording.names) == {None}
    assert set(read_segments(find_segments(path), recording).layers) == {*LAYERS}
    assert shares == [1.0]
    with np.load(path.with_name("subject1_hands.npz"), allow_pickle=False) as hands:
        assert hands["left"].shape == (len(recording.time), 7)


def test_a_sensor_suit_leaves_nothing_unnamed(tmp_path):
    with pytest.raises(ConfigError, match="gestures: seen by a suit"):
        list(captures("gestures", 1, 1, room=Room()))
    with pytest.raises(ConfigError, match="step: rate_hz: got 20, expected 60 to 500"):
        list(captures("step", 1, 1, rate_hz=20))


def test_the_unnamed_sample_is_what_the_generator_writes(tmp_path):
    write_synthetic("stick_throw", tmp_path, 2, 8, 100, room=Room())
    for path in sorted((DATA / "stick_throw_unlabelled").iterdir()):
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name
