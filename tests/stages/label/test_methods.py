"""Labelling by whatever names there are."""

from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import LabellingError
from besman.stages.label.fragments import split_fragments
from besman.stages.label.methods import LabelAutoConfig
from besman.stages.label.named_recording import NamedRecording
from besman.stages.label.naming import FREE, label_fragments
from besman.stages.label.results import label_results
from besman.stages.label.scores import GHOST
from besman.stages.label.stage import LabelConfig, LabelTrajectoriesConfig
from besman.stages.label.trajectories import learn_from_recording, name_trajectories

AUTO = LabelAutoConfig(longest_gap_s=0.3)
HAND = ("hand_top", "hand_left", "hand_right")


@pytest.fixture(scope="module")
def named(clean):
    """The clean capture with all names."""
    recording = clean.recording
    return replace(recording, positions=clean.positions, names=clean.markers, source="named.tsv")


def hide_names(recording, *hidden):
    """Take names away, and break these trajectories in two, with a short gap between."""
    positions, names = [], []
    middle = len(recording.time) // 2
    for k, name in enumerate(recording.names):
        path = recording.positions[:, k]
        if name not in hidden:
            positions.append(path)
            names.append(name)
            continue
        for kept in (slice(0, middle), slice(middle + 4, None)):
            part = np.full_like(path, np.nan)
            part[kept] = path[kept]
            positions.append(part)
            names.append(None)
    return replace(recording, positions=np.stack(positions, axis=1), names=tuple(names))


def names_of(config, recording, marker_set, *teacher):
    (labelled,) = config.run((recording,), marker_set, *teacher)
    (names,) = label_results((recording,), (labelled,), marker_set)["names"]
    return labelled, (names["taken"], names["found"])


def test_names_that_make_up_the_set_are_taken_as_they_are(named, marker_set):
    expected = LabelConfig(longest_gap_s=0.3).run((named,), marker_set)[0]
    labelled, count = names_of(AUTO, named, marker_set)
    assert not isinstance(labelled, NamedRecording)
    assert labelled.markers == expected.markers
    np.testing.assert_array_equal(labelled.positions, expected.positions)
    assert count == (len(named.names), 0)


@pytest.mark.parametrize("names", [None, "U{}"])
def test_without_names_that_fit_all_trajectories_are_named(spoilt, marker_set, teacher, names):
    n = len(spoilt.recording.names)
    called = tuple(None if names is None else names.format(k) for k in range(n))
    recording = replace(spoilt.recording, names=called)
    limits = {"longest_gap_s": 10.0, "longest_rigid_gap_s": 10.0}
    trajectories = LabelTrajectoriesConfig(**limits)
    (expected,) = trajectories.run((recording,), marker_set, teacher)
    labelled, count = names_of(LabelAutoConfig(**limits), recording, marker_set, teacher)
    assert isinstance(labelled, NamedRecording)
    np.testing.assert_array_equal(labelled.positions, expected.positions)
    assert labelled.decisions == expected.decisions
    assert count == (0, len(expected.markers))
    figures = label_results((recording,), (labelled,), marker_set, looks_at_names=False)
    assert figures["names"][0]["taken"] == 0


@pytest.mark.parametrize("hidden", [HAND, ("hand_left",), ("elbow", "stick"), ("stick",)])
def test_what_has_no_name_is_named_beside_what_has(named, marker_set, teacher, hidden):
    recording = hide_names(named, *hidden)
    labelled, count = names_of(AUTO, recording, marker_set, teacher)
    assert isinstance(labelled, NamedRecording)
    assert labelled.markers == named.names
    assert count == (len(named.names) - len(hidden), len(hidden))
    seen = ~labelled.filled
    np.testing.assert_array_equal(labelled.positions[seen], named.positions[seen])
    assert seen.all(axis=0).sum() == len(named.names) - len(hidden)


def test_names_that_are_given_are_kept_against_all_likelihood(named, marker_set, teacher):
    # Turned in a circle, a hand still has left and right as hands have.
    wrong = {"hand_left": "hand_right", "hand_right": "hand_top", "hand_top": "hand_left"}
    exchanged = replace(named, names=tuple(wrong.get(name, name) for name in named.names))
    recording = hide_names(exchanged, "shoulder", "elbow")
    (labelled,) = AUTO.run((recording,), marker_set, teacher)
    for marker, other in wrong.items():
        np.testing.assert_array_equal(
            labelled.marker(other), named.positions[:, named.names.index(marker)]
        )
    given = [one for one in labelled.decisions if recording.names[one.trajectory] is not None]
    assert {one.confidence for one in given} == {1.0}


def test_a_marker_that_is_named_for_a_part_is_completed(named, marker_set, teacher):
    k = named.names.index("hand_top")
    positions = np.concatenate([named.positions, named.positions[:, k : k + 1]], axis=1)
    positions[500:, k] = np.nan
    positions[:502, -1] = np.nan
    recording = replace(named, positions=positions, names=(*named.names, None))
    labelled, count = names_of(AUTO, recording, marker_set, teacher)
    seen = ~labelled.filled[:, k]
    np.testing.assert_array_equal(labelled.marker("hand_top")[seen], named.positions[seen, k])
    assert (~seen).sum() == 2
    assert count == (len(named.names), 0)


def test_what_is_called_otherwise_is_no_marker(named, marker_set, teacher):
    called = tuple("other" if name == "elbow" else name for name in named.names)
    with pytest.raises(LabellingError, match="marker 'elbow' of right_arm is not there; got: "):
        AUTO.run((replace(named, names=called),), marker_set, teacher)
    ghosts = np.full((len(named.time), 1, 3), 5.0)
    positions = np.concatenate([named.positions, ghosts], axis=1)
    recording = replace(named, positions=positions, names=(*called, None))
    with pytest.raises(LabellingError, match="marker 'elbow' of right_arm was not found"):
        AUTO.run((recording,), marker_set, teacher)


def test_two_of_one_name(named, marker_set):
    twice = replace(named, names=("elbow", *named.names[1:]))
    with pytest.raises(LabellingError, match="both stand for marker 'elbow'"):
        AUTO.run((twice,), marker_set)


def test_a_gap_too_long_is_said_if_nothing_without_a_name_can_fill_it(named, marker_set, teacher):
    positions = named.positions.copy()
    positions[100:400, named.names.index("elbow")] = np.nan
    hidden = replace(named, positions=positions)
    said = "named.tsv: marker 'elbow' is not seen in frames 101 to 400"
    for recording in (hidden, hide_names(hidden, "stick")):
        with pytest.raises(LabellingError, match=said):
            AUTO.run((recording,), marker_set, teacher)


def test_without_anything_to_learn_from_names_are_enough(named, marker_set):
    bare = marker_set.model_copy(update={"pose_m": {}})
    ghosts = np.full((len(named.time), 1, 3), 5.0)
    positions = np.concatenate([named.positions, ghosts], axis=1)
    recording = replace(named, positions=positions, names=(*named.names, None))
    labelled, _ = names_of(AUTO, recording, bare)
    assert labelled.markers == named.names
    with pytest.raises(LabellingError, match=r"pose_m .* or a recording with names to learn"):
        AUTO.run((hide_names(named, "elbow"),), bare)


def test_a_marker_that_the_model_does_not_know_keeps_its_name(named, marker_set):
    # The pose says nothing of the stick.
    recording = hide_names(named, "hand_left")
    labelled, count = names_of(AUTO, recording, marker_set)
    stick = named.positions[:, named.names.index("stick")]
    np.testing.assert_array_equal(labelled.marker("stick"), stick)
    assert count == (8, 1)


def test_known_names_are_held_and_share_no_frame(spoilt, marker_set, teacher):
    model = learn_from_recording(teacher, marker_set)
    recording = spoilt.recording
    fragments = split_fragments(recording.positions, recording.rate_hz)
    true = np.array(
        [
            model.markers.index(name) if (name := spoilt.truth[first][column]) != "ghost" else GHOST
            for first, column in zip(fragments.start, fragments.column, strict=True)
        ]
    )
    every_third = np.arange(len(true)) % 3 == 0
    known = np.where(every_third, true, FREE)
    free = label_fragments(fragments, model)
    held = label_fragments(fragments, model, known=known)
    np.testing.assert_array_equal(held.labels[every_third], true[every_third])
    assert np.all(held.confidence[every_third] == 1.0)
    both = ~every_third & (held.labels != GHOST)
    np.testing.assert_array_equal(held.labels[both], true[both])
    assert np.sum(held.labels == true) >= np.sum(free.labels == true)
    for marker in range(model.n_markers):
        mine = np.flatnonzero(held.labels == marker)
        assert np.all(fragments.start[mine[1:]] >= fragments.stop[mine[:-1]])


def test_names_are_not_looked_at_unless_they_are_given(named, marker_set, teacher):
    model = learn_from_recording(teacher, marker_set)
    found = name_trajectories(replace(named, names=("elbow",) * 9), marker_set, model, 0.8)
    np.testing.assert_array_equal(found.positions, named.positions)
