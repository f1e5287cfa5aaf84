import itertools
from dataclasses import replace

import numpy as np
import pytest

from besman.annotate.naming import NamedView
from besman.annotate.session import Session
from besman.annotate.sources import load_models
from besman.annotate.takes import Take
from besman.exceptions import LabellingError
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.segments_json import read_segments
from besman.records import Recording
from besman.stages.recognize.model import name_segments, rank_classes
from besman.stages.recognize.stage import RecognizeConfig
from besman.standalone.train_files import train_files


@pytest.fixture
def truth(recording_path, truth_path):
    return read_segments(truth_path, read_recording(recording_path))


def page_rows(truth, rows):
    return [[*truth.bounds[k].tolist(), truth.labels[k], ""] for k in rows]


def test_stretches_cover_the_recording_and_meet_the_truth(recording_path, truth):
    take = Session([recording_path]).takes[0]
    stretches = take.stretches("")
    assert stretches[0].start == 0
    assert stretches[-1].end == len(take.recording.time)
    assert all(a.end == b.start for a, b in itertools.pairwise(stretches))
    assert all(0 <= one.confidence <= 1 for one in stretches)
    borders = np.array([one.start for one in stretches[1:]])
    margin = 0.2 * take.recording.rate_hz
    assert all(np.abs(borders - start).min() < margin for start, _ in truth.bounds[1:])


def test_names_come_from_what_is_labelled_and_are_right(recording_path, truth):
    session = Session([recording_path])
    take = session.takes[0]
    known, open_ = range(4), range(4, len(truth.labels))
    bounds = [tuple(truth.bounds[k].tolist()) for k in open_]
    found = session.name(take, "", page_rows(truth, known), bounds)
    assert found["n_examples"] == 4
    assert [name.label for name in found["names"]] == [truth.labels[k] for k in open_]
    assert all(0 < name.confidence < 1 for name in found["names"])


def test_nothing_labelled_nothing_named(recording_path):
    session = Session([recording_path])
    found = session.name(session.takes[0], "", [], [(0, 50), (50, 90)])
    assert found == {"names": [None, None], "n_examples": 0}


def test_a_single_example_names_all_and_is_not_sure(recording_path, truth):
    session = Session([recording_path])
    rows = page_rows(truth, [2])
    # Without rests around it there is one class only.
    found = session.name(session.takes[0], "", rows, [tuple(truth.bounds[2].tolist())])
    assert found["names"][0].label == truth.labels[2]
    assert session.name(session.takes[0], "actions", rows, [(0, 50)])["names"] == [None]


def test_segments_of_the_other_arm_teach_nothing(recording_path, truth):
    session = Session([recording_path])
    rows = [[*row[:3], "left_hand"] for row in page_rows(truth, range(4))]
    found = session.name(session.takes[0], "right_hand", rows, [(0, 50)])
    assert found == {"names": [None], "n_examples": 0}


def test_names_given_while_the_markers_are_looked_at(recording_path):
    take = Take(recording_path)

    class Lock:
        """Names are given as soon as the lock is free."""

        def __enter__(self):
            pass

        def __exit__(self, *_):
            take._show(NamedView(take.recording, {}))

    take._lock = Lock()
    recording, _ = take.labelled()
    assert recording.source == str(recording_path)
    assert take.stretches("right_hand")


def test_what_is_labelled_in_one_recording_names_the_next(recording_path, truth_path, truth):
    other = recording_path.parent / "more" / recording_path.name
    other.parent.mkdir()
    write_recording(read_recording(recording_path), other)
    own = recording_path.with_name("throws_manually_segmented.json")
    own.write_bytes(truth_path.read_bytes())
    session = Session([recording_path, other])
    bounds = [tuple(row) for row in truth.bounds.tolist()]
    found = session.name(session.takes[1], "", [], bounds)
    assert [name.label for name in found["names"]] == list(truth.labels)


def test_trained_model_names_too(recording_path, truth_path, truth, tmp_path):
    own = recording_path.with_name("throws_manually_segmented.json")
    own.write_bytes(truth_path.read_bytes())
    train_files([recording_path], tmp_path / "model", "right_arm", ())
    own.unlink()

    session = Session([recording_path], models=load_models(None, tmp_path / "model"))
    assert set(truth.labels) <= set(session.known_labels())
    bounds = [tuple(row) for row in truth.bounds.tolist()]
    found = session.name(session.takes[0], "", [], bounds)
    assert [name.label for name in found["names"]] == list(truth.labels)


def test_nearest_class_is_the_label_and_its_distance_the_uncertainty(
    recording_path, truth_path, truth
):
    own = recording_path.with_name("throws_manually_segmented.json")
    own.write_bytes(truth_path.read_bytes())

    recording, _ = Session([recording_path]).takes[0].labelled()
    stage = RecognizeConfig(examples_per_class=1, unknown_factor=None)
    model = stage.train((recording,), (replace(truth, source=recording.source),))
    labels, distances = name_segments(model, recording, truth.bounds)
    apart = rank_classes(model, recording, truth.bounds)
    assert [model.classes[k] for k in apart.argmin(axis=1)] == list(labels)
    np.testing.assert_allclose(apart.min(axis=1), distances)


def test_recording_without_known_markers_has_no_proposals_and_says_why(recording_path, tmp_path):
    recording = read_recording(recording_path)
    names = tuple(f"m{k}" for k in range(len(recording.names)))
    path = tmp_path / "strange.tsv"
    write_recording(
        Recording(recording.time, recording.positions, names, recording.rate_hz, path.name), path
    )
    take = Session([path]).takes[0]
    with pytest.raises(LabellingError, match="marker 'back_top' of right_arm is not there"):
        take.stretches("")
