from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import LabellingError
from besman.person.marker_set import MarkerSet
from besman.records import Recording
from besman.records.files import load_record, save_record
from besman.stages.label.named_recording import NamedRecording
from besman.stages.label.results import label_results
from besman.stages.label.stage import LabelTrajectoriesConfig
from besman.stages.label.trajectories import learn_from_recording, name_trajectories


@pytest.fixture(scope="module")
def model(teacher, marker_set):
    return learn_from_recording(teacher, marker_set)


def names_by_sample(named, n_columns):
    table = np.full((len(named.time), n_columns), "", dtype=object)
    for decision in named.decisions:
        if decision.named:
            table[decision.start : decision.stop, decision.trajectory] = decision.marker
    return table


def test_nothing_missing_all_named(clean, marker_set, model):
    named = name_trajectories(clean.recording, marker_set, model, 0.8)
    assert named.markers == clean.markers
    np.testing.assert_array_equal(named.positions, clean.positions)
    assert clean.count(named)[1] == 0
    assert named.review == ()


def test_gaps_and_ghosts(spoilt, marker_set, model):
    named = name_trajectories(spoilt.recording, marker_set, model, 0.8)
    right, wrong = spoilt.count(named)
    assert wrong == 0
    visible = np.isfinite(spoilt.recording.positions[..., 0]).sum()
    assert right > 0.8 * visible
    assert all(0.0 <= decision.confidence <= 1.0 for decision in named.decisions)
    assert all(decision.confidence >= 0.8 for decision in named.decisions if decision.named)
    assert {d.confidence < 0.8 for d in named.review} <= {True}


@pytest.mark.parametrize("seed", range(3))
def test_the_frame_of_the_laboratory_does_not_matter(spoilt, marker_set, model, seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    moved = spoilt.recording.positions @ turn.T + rng.normal(size=3)
    one = name_trajectories(spoilt.recording, marker_set, model, 0.8)
    other = name_trajectories(replace(spoilt.recording, positions=moved), marker_set, model, 0.8)
    n = spoilt.recording.positions.shape[1]
    np.testing.assert_array_equal(names_by_sample(one, n), names_by_sample(other, n))


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_the_trajectories_does_not_matter(spoilt, marker_set, model, seed):
    n = spoilt.recording.positions.shape[1]
    order = np.random.default_rng(seed).permutation(n)
    shuffled = replace(spoilt.recording, positions=spoilt.recording.positions[:, order])
    one = names_by_sample(name_trajectories(spoilt.recording, marker_set, model, 0.8), n)
    other = names_by_sample(name_trajectories(shuffled, marker_set, model, 0.8), n)
    np.testing.assert_array_equal(one[:, order], other)


def test_not_from_the_initial_pose_and_hidden_at_the_start(clean, marker_set, model):
    positions = clean.recording.positions[700:].copy()
    positions[:100, :3] = np.nan
    part = replace(clean.recording, positions=positions, time=clean.recording.time[700:])
    named = name_trajectories(part, marker_set, model, 0.8)
    for decision in named.decisions:
        if decision.named:
            assert clean.truth[700 + decision.start][decision.trajectory] == decision.marker
    assert set(marker_set.required) <= set(named.markers)


def test_all_hidden_for_a_while(clean, marker_set, model):
    positions = clean.recording.positions.copy()
    positions[600:630] = np.nan
    dark = replace(clean.recording, positions=positions)
    named = name_trajectories(dark, marker_set, model, 0.8)
    assert clean.count(named)[1] == 0
    assert np.isnan(named.positions[600:630]).all()
    with pytest.raises(
        LabellingError, match=r"^unnamed.tsv: marker '\w+' is not seen in frames 60"
    ):
        LabelTrajectoriesConfig(longest_gap_s=0.1).run(
            (dark,), marker_set, teacher_of(clean, marker_set)
        )


def teacher_of(unnamed, marker_set):
    return Recording(
        unnamed.recording.time, unnamed.positions, unnamed.markers, 100.0, "teacher.tsv"
    )


def test_empty_recording(clean, marker_set, model):
    empty = replace(clean.recording, positions=np.full_like(clean.recording.positions, np.nan))
    with pytest.raises(LabellingError, match=r"^unnamed.tsv: nothing to name: no marker is seen "):
        name_trajectories(empty, marker_set, model, 0.8)


def test_few_frames_name_all_or_nothing(clean, marker_set, model):
    few = replace(
        clean.recording,
        positions=clean.recording.positions[:60],
        time=clean.recording.time[:60],
    )
    named = name_trajectories(few, marker_set, model, 0.8)
    assert clean.count(named)[1] == 0
    assert len(named.decisions) == few.positions.shape[1]
    one = replace(few, positions=few.positions[:1], time=few.time[:1])
    with pytest.raises(LabellingError, match="6 of 8 required markers found, without shoulder, e"):
        name_trajectories(one, marker_set, model, 0.8)


def test_a_marker_set_that_does_not_fit(marker_set, model):
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.normal(scale=0.003, size=(400, 6, 3)), axis=0)
    stranger = Recording(
        np.arange(400) / 100, walk + rng.normal(size=(6, 3)) * 2.0, (None,) * 6, 100.0, "x.tsv"
    )
    with pytest.raises(
        LabellingError,
        match=r"^x.tsv: marker set right_arm does not fit, nothing is named: \d of 8 required "
        r"markers found, without .*, among 6 trajectories; expected those of this person's markers",
    ):
        name_trajectories(stranger, marker_set, model, 0.8)


def test_teachers_that_teach_nothing(teacher, marker_set):
    short = replace(teacher, positions=teacher.positions[:10], time=teacher.time[:10])
    with pytest.raises(LabellingError, match=r"subject1.tsv: 10 frames \(0.1 s\) are too few"):
        learn_from_recording(short, marker_set)
    positions = teacher.positions.copy()
    elbow = marker_set.match(teacher.names, "")["elbow"]
    positions[:, elbow] = np.nan
    with pytest.raises(LabellingError, match="marker 'elbow' of right_arm is never seen"):
        learn_from_recording(replace(teacher, positions=positions), marker_set)
    names = list(teacher.names)
    names[(elbow + 1) % len(names)] = "ELBOW"
    with pytest.raises(LabellingError, match="both stand for marker 'elbow'"):
        learn_from_recording(replace(teacher, names=tuple(names)), marker_set)


def test_stage_fills_and_reports(spoilt, teacher, marker_set, tmp_path):
    config = LabelTrajectoriesConfig(longest_gap_s=0.3)
    (named,) = config.run((spoilt.recording,), marker_set, teacher)
    required = [named.markers.index(marker) for marker in marker_set.required]
    assert np.isfinite(named.positions[:, required]).all()
    truth = spoilt.positions[:, [spoilt.markers.index(marker) for marker in named.markers]]
    error = np.linalg.norm(named.positions - truth, axis=2)
    assert named.filled.any()
    assert np.nanmax(np.where(named.filled, error, np.nan)[:, required]) < 0.03
    assert np.nanmedian(np.where(named.filled, error, np.nan)[:, required]) < 0.001
    results = label_results((spoilt.recording,), (named,), marker_set)
    assert results["fragments"] == len(named.decisions)
    assert results["n_unnamed"] == sum(not d.named for d in named.decisions)
    assert len(results["review"]) == len(named.review)
    for row in results["review"]:
        assert row["recording"] == "unnamed.tsv"
        assert row["first_frame"] <= row["last_frame"]
        assert row["confidence"] < 0.8
    save_record((named,), tmp_path / "r.npz")
    (again,) = load_record(tmp_path / "r.npz")
    assert isinstance(again, NamedRecording)
    assert again.decisions == named.decisions


def test_truth_gives_shares(clean, teacher, marker_set):
    (named,) = LabelTrajectoriesConfig().run((clean.recording,), marker_set, teacher)
    truth = [
        next(frame[column] for frame in clean.truth if frame[column] != "ghost")
        for column in range(len(clean.recording.names))
    ]
    results = label_results((clean.recording,), (named,), marker_set, (tuple(truth),))
    assert results["wrong_share"] == 0.0
    assert results["right_share"] > 0.99
    truth[0] = "ghost"
    worse = label_results((clean.recording,), (named,), marker_set, (tuple(truth),))
    assert worse["wrong_share"] > 0.1


def test_a_required_marker_that_was_not_found(clean, teacher, marker_set):
    place = next(k for k in range(len(clean.recording.names)) if "elbow" in clean.truth[0][k])
    positions = np.delete(clean.recording.positions, place, axis=1)
    blind = replace(clean.recording, positions=positions, names=clean.recording.names[1:])
    with pytest.raises(
        LabellingError,
        match=r"^unnamed.tsv: marker set right_arm does not fit, nothing is named: 7 of 8 required "
        r"markers found, without elbow, among 8 trajectories; expected those of this person's",
    ):
        LabelTrajectoriesConfig().run((blind,), marker_set, teacher)


def test_from_the_pose_of_the_set_alone(clean, marker_set):
    (named,) = LabelTrajectoriesConfig().run((clean.recording,), marker_set)
    assert clean.count(named)[1] == 0
    assert set(named.markers) >= set(marker_set.required)


def test_a_set_without_a_pose(clean):
    bare = MarkerSet(name="bare", markers={"a": (), "b": ()}, required=("a",))
    with pytest.raises(
        LabellingError, match="marker set bare: pose_m does not say where marker 'a' is"
    ):
        LabelTrajectoriesConfig().run((clean.recording,), bare)
