"""Names while frames come, against the truth: at once, when points are exchanged, after gaps."""

import numpy as np
import pytest

from besman.config.resources import resource_folder
from besman.evaluation.degradation import DegradeRecipe, degrade_recording
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.online import OnlineNaming
from besman.stages.label.scores import GHOST
from besman.stages.label.trajectories import learn_from_recording

DATA = resource_folder("data")


@pytest.fixture(scope="module")
def person():
    """Model of another person, and eight seconds of one as the model's columns."""
    marker_set = load_marker_set("right_arm")
    teacher = read_recording(DATA / "stick_throw_calibration" / "person.tsv")
    model = learn_from_recording(teacher, marker_set)
    recording = read_recording(DATA / "stick_throw" / "subject1.tsv")
    columns = marker_set.match(recording.names, recording.source)
    positions = recording.positions[:800, [columns[name] for name in model.markers]]
    required = np.array([model.markers.index(name) for name in marker_set.required])
    return model, required, positions, recording.rate_hz


def name(person, positions):
    """Return what was said of each point, and the changes by frame."""
    model, required, _, rate_hz = person
    naming = OnlineNaming(model, required, positions.shape[1], rate_hz)
    said, changes = np.full(positions.shape[:2], GHOST), []
    for row, frame in enumerate(positions):
        changes.append(naming.take(frame))
        if naming.has_begun:
            said[row] = naming.names
    return said, changes


def test_names_that_were_taken_away_are_found_within_a_second(person):
    """The stick, which nothing is rigid with, when it was seen for as long as no ghost is."""
    positions, stick = person[2], person[0].markers.index("stick")
    order = np.random.default_rng(0).permutation(positions.shape[1])
    said, changes = name(person, positions[:, order])
    assert (said[300:450, order == stick] == stick).all()
    body = order != stick
    np.testing.assert_array_equal(said[100:, body], np.tile(order[body], (700, 1)))
    assert ((said == order) | (said == GHOST)).all()
    told = [one for row in changes for one in row if one.column != order.tolist().index(stick)]
    # Each is told once.
    assert sorted(one.marker for one in told) == sorted(order[body])
    assert all(one.was == GHOST and one.confidence >= 0.8 for one in told)


def test_points_that_are_exchanged_between_two_frames_keep_their_names(person):
    positions = person[2]
    random = np.random.default_rng(1)
    orders = np.tile(np.arange(positions.shape[1]), (800, 1))
    for row in range(100, 800, 7):
        orders[row:] = random.permutation(positions.shape[1])
    mixed = np.take_along_axis(positions, orders[:, :, None], axis=1)
    said, _ = name(person, mixed)
    body = orders != person[0].markers.index("stick")
    np.testing.assert_array_equal(said[100:][body[100:]], orders[100:][body[100:]])


def test_broken_trajectories_with_ghosts_are_named_again(person):
    positions, rate_hz = person[2:]
    spoilt = degrade_recording(positions, rate_hz, DegradeRecipe(0.03, 0.3), 5)
    said, changes = name(person, spoilt.positions)
    seen = spoilt.truth >= 0
    begun = int(np.argmax((said != GHOST).any(axis=1)))
    assert begun < 50
    seen[:begun] = False
    seen &= spoilt.truth != person[0].markers.index("stick")
    assert (said[seen] == spoilt.truth[seen]).mean() > 0.97
    assert ((said != GHOST) & (said != spoilt.truth)).sum() < 0.005 * seen.sum()
    # What is told is what is said: following the changes alone gives the same names.
    followed = np.full(spoilt.positions.shape[1], GHOST)
    for row, told in enumerate(changes):
        followed[~np.isfinite(spoilt.positions[row, :, 0])] = GHOST
        for one in told:
            assert one.was == followed[one.column]
            followed[one.column] = one.marker
        if said[row].any() and row >= begun:
            np.testing.assert_array_equal(said[row], followed)


def test_nobody_is_found_among_points_that_are_no_person(person):
    model, required, positions, rate_hz = person
    naming = OnlineNaming(model, required, 5, rate_hz)
    for frame in positions[:120, :5]:
        naming.take(frame)
    assert not naming.has_begun
    naming.take(np.full((5, 3), np.nan))
    assert (naming.names == GHOST).all()
