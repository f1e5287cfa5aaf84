"""Marker sets of two arms, a sensor suit and an exoskeleton: from files to names."""

import dataclasses
import functools
import hashlib
import json
import shutil

import numpy as np
import pytest
from small_runs import keep_demonstrations

from besman.cli import main as cli
from besman.config.resources import find_resource
from besman.exceptions import MappingError
from besman.geometry.frames import quaternion_to_rotation
from besman.io.recordings.formats import find_companions, read_recording
from besman.person.body import find_body
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import load_pipeline
from besman.stages.compose.actions import cut_paths
from besman.stages.label.stage import LabelConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.select.hand_trajectory import map_record
from besman.standalone.segment_files import segment_files
from besman.synthetic.datasets import captures, write_synthetic
from besman.synthetic.gestures import GESTURE_CLASSES

SETS = {"two_arms": "object_rotation", "xsens": "gestures", "exoskeleton": "rotation"}
LEVELS = {
    "two_arms": [["lift", "turn_clockwise", "turn_counterclockwise", "place", "idle"]],
    "xsens": [[*GESTURE_CLASSES, "idle"]],
}
HANDS = {"two_arms": "hand_top", "xsens": "right_hand", "exoskeleton": "right_wrist"}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """One folder of recordings for each marker set (synthetic)."""
    found = {}
    for markers, dataset in SETS.items():
        found[markers] = tmp_path_factory.mktemp(markers)
        write_synthetic(dataset, found[markers], 2, 3, seed=1)
    return found


@pytest.fixture(scope="module")
def label(folders):
    """Read the recordings of a marker set and name their markers; return both, each set once."""

    @functools.cache
    def read_and_name(markers):
        inputs = read_inputs([str(folders[markers])])
        named = LabelConfig(markers=markers).run(inputs.recordings, load_marker_set(markers))
        return inputs, named

    return read_and_name


@pytest.mark.parametrize("markers", SETS)
def test_from_files_to_names(label, markers):
    inputs, recordings = label(markers)
    assert find_body(recordings[0].markers, "a").arms[0].hand == HANDS[markers]
    stage = RecognizeConfig(examples_per_class=4)
    model = stage.train(recordings, inputs.truth)
    assert "hand_orientation" in model.recipe.features
    right = total = 0
    for recording, truth in zip(recordings, inputs.truth, strict=True):
        layers = truth.layers or ("right_hand",) * len(truth.labels)
        blocks = truth.take([k for k, layer in enumerate(layers) if layer == "right_hand"])
        (named,) = stage.run((recording,), (blocks,), model)
        right += sum(a == b for a, b in zip(named.labels, blocks.labels, strict=True))
        total += len(blocks.labels)
    assert right / total > 0.8


@pytest.mark.parametrize("markers", SETS)
def test_segments_without_naming_a_hand(folders, label, markers):
    first = label(markers)[0].recordings[0].source
    (found,) = segment_files([folders[markers] / first], "valley_vmci", markers, None)
    assert len(found["borders_s"]) > 6


@pytest.mark.parametrize("markers", ["xsens", "exoskeleton"])
def test_orientations_of_the_markers_that_are_kept(label, markers):
    inputs, recordings = label(markers)
    raw, labelled = inputs.recordings[0], recordings[0]
    columns = load_marker_set(markers).match(raw.names, raw.source)
    for k, name in enumerate(labelled.markers):
        np.testing.assert_array_equal(
            labelled.orientations[:, k], raw.orientations[:, columns[name]]
        )


def test_positions_alone_have_no_orientations(label):
    inputs, _ = label("xsens")
    bare = tuple(dataclasses.replace(one, orientations=None) for one in inputs.recordings)
    recordings = LabelConfig(markers="xsens").run(bare, load_marker_set("xsens"))
    assert recordings[0].orientations is None
    model = RecognizeConfig().train(recordings, inputs.truth)
    assert "hand_orientation" not in model.recipe.features
    with pytest.raises(MappingError, match="a: nothing tells how right_hand is turned; expected"):
        map_record(recordings[0], (50, 100), "x", name="a")


@pytest.mark.parametrize(("dataset", "side"), [("gestures", "right"), ("object_rotation", "left")])
def test_the_hand_of_a_demonstration_is_the_simulated_one(dataset, side):
    capture = next(captures(dataset, 1, 1, seed=2))
    markers = "xsens" if dataset == "gestures" else "two_arms"
    (recording,) = LabelConfig(markers=markers).run((capture.recording,), load_marker_set(markers))
    rows = (100, 160)
    hand = map_record(
        recording, rows, "x", name="a", side=side, rate_hz=recording.rate_hz, cutoff_hz=30.0
    )
    true = quaternion_to_rotation(capture.body.hands[side][rows[0] : rows[1], 3:])
    found = quaternion_to_rotation(hand.poses[:, 3:])
    assert len(found) == len(true)
    # Seen from the back or from the laboratory, the hand turns by as much about the same axes.
    np.testing.assert_allclose(
        np.swapaxes(found[:1], 1, 2) @ found, np.swapaxes(true[:1], 1, 2) @ true, atol=0.05
    )
    # Against gravity it points the same way.
    np.testing.assert_allclose(found[:, 2], true[:, 2], atol=0.05)


def test_actions_in_a_suit_do_not_depend_on_where_the_person_stands(label):
    _, recordings = label("xsens")
    one = recordings[0]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    other = dataclasses.replace(one, positions=one.positions @ turn.T + [1.0, -2.0, 0.0])
    spans, markers = [(20, 90), (50, 200)], load_marker_set("xsens").arms[:3]
    np.testing.assert_allclose(
        cut_paths(one, spans, markers, 10), cut_paths(other, spans, markers, 10), atol=1e-9
    )


def test_an_arm_that_was_not_recorded_is_refused(label):
    _, recordings = label("xsens")
    with pytest.raises(MappingError, match=r"a: the left arm is not complete; got .*right_hand"):
        map_record(recordings[0], (50, 100), "x", name="a", side="left")
    bare = dataclasses.replace(
        recordings[0],
        markers=tuple("c7" if name == "t8" else name for name in recordings[0].markers),
    )
    with pytest.raises(MappingError, match=r"a: .*no marker 'back_top': the person's frame needs"):
        map_record(bare, (50, 100), "x", name="a")


def test_stages_look_at_the_arms_of_the_marker_set():
    path = find_resource("pipelines", "ur5_reach")
    compose = "compose={levels: [[a]], hands: []}"
    config = load_pipeline(path, ("label.markers=xsens", compose))
    assert config.segment.markers == ("right_hand",)
    assert config.compose.markers[:3] == ("right_hand", "right_fore_arm", "right_upper_arm")
    assert config.compose.hands == ()
    config = load_pipeline(path, ("label.markers=xsens", "segment.markers=[left_hand]"))
    assert config.segment.markers == ("left_hand",)
    assert load_pipeline(path).segment.markers == ("hand_top",)


@pytest.mark.slow
@pytest.mark.parametrize(("markers", "name"), [("two_arms", "lift"), ("xsens", "stop")])
def test_a_run_from_recordings_to_the_robot(folders, markers, name, tmp_path, monkeypatch, undrawn):
    found = keep_demonstrations(monkeypatch, 1)
    # A gesture has several bells, each of which is a block: as a whole it is an action.
    action = (
        "select.label=null",
        f"select.action={name}",
        f"compose={{levels: {LEVELS[markers]}}}",
    )
    settings = (
        f"recordings={folders[markers]}", f"label.markers={markers}", *action,
        "map.evaluations=20", "map.yaw=false", "map.correct=false", "map.greatest_error_m=1.0",
        "refine.episodes=2", "refine.robustness=null",
    )  # fmt: skip
    arguments = [part for one in settings for part in ("--set", one)]
    run = ["besman", "run", "ur5_reach", "--out", str(tmp_path / "run"), *arguments]
    monkeypatch.setattr("sys.argv", run)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert not stop.value.code
    results = json.loads((tmp_path / "run" / "results.json").read_text())
    assert len(found) > 1
    assert results["map"]["n_demonstrations"] == 1
    assert results["segment"]["marker"] == HANDS[markers]


def test_the_urdf_of_a_joint_log_is_among_the_checksums(folders, tmp_path):
    shared = find_resource("configs/exoskeleton", "dual_arm_example", ".urdf")
    sha = hashlib.sha256(shared.read_bytes()).hexdigest()
    assert read_inputs([str(folders["exoskeleton"])]).checksums[shared.name] == sha
    log = next(folders["exoskeleton"].glob("*.csv"))
    for folder, text in (("a", ""), ("b", "\n")):
        own = tmp_path / folder
        own.mkdir()
        shutil.copy(shared, own / "own.urdf")
        with (own / "own.urdf").open("a") as file:
            file.write(text)
        changed = log.read_text().replace("dual_arm_example", "own.urdf")
        (own / f"{folder}.csv").write_text(changed)
    found = read_inputs([str(tmp_path / "a"), str(tmp_path / "b")]).checksums
    other = hashlib.sha256((tmp_path / "b" / "own.urdf").read_bytes()).hexdigest()
    assert (found["own.urdf"], found["b.csv: own.urdf"]) == (sha, other)
    assert find_companions(tmp_path / "a" / "a.csv") == (tmp_path / "a" / "own.urdf",)
    assert read_recording(tmp_path / "a" / "a.csv").orientations is not None
