"""Actions of a stream whose borders are known, against those of the whole recording."""

import itertools

import numpy as np
import pytest
from steps import step_recording

from besman.following.actions import ActionStream
from besman.following.frames import FrameBuffer
from besman.stages.compose.actions import compose_levels, train_level
from besman.stages.label.hold_last_sighting import HeldSample

ARM = ("hand_top", "elbow", "shoulder")


@pytest.fixture(scope="module")
def case():
    lesson, _, actions = step_recording(["step_up", "step_down"] * 2, seed=2)
    model = train_level([lesson], [actions.bounds], [actions.labels], ARM)
    recording, blocks, _ = step_recording(["step_up", "step_down"] * 2, seed=1)
    return model, recording, blocks.bounds


def make_stream(model, recording):
    frames = FrameBuffer(recording.markers, recording.rate_hz, recording.source, 1)
    return ActionStream([model], None, None, {}, frames), frames


def feed(frames, recording, start, stop, lost=()):
    gone = np.isin(recording.markers, lost)
    none = np.zeros(len(recording.markers), dtype=bool)
    for row in recording.positions[start:stop]:
        frames.add(HeldSample(row, none, gone))


def test_actions_are_those_of_the_whole_recording_once_it_is_over(case):
    model, recording, bounds = case
    stream, frames = make_stream(model, recording)
    row = 0
    for end in bounds[:-1, 1].tolist():
        feed(frames, recording, row, end + 1)
        row = end + 1
        after = stream.candidates.final_border
        known = [b for b in bounds[:, 1].tolist() if after < b <= end]
        stream.update([known], end, False)
    feed(frames, recording, row, len(recording.time))
    after = stream.candidates.final_border
    known = [b for b in bounds[:, 1].tolist() if b > after]
    stream.update([known], known[-1], True)
    assert stream.final_row == bounds[-1, 1]
    (whole,) = compose_levels(recording, [0, *bounds[:, 1].tolist()], [model])
    (ledger,) = stream.ledgers
    assert [(one.start, one.end) for one in ledger.pieces] == list(
        itertools.pairwise(whole.borders)
    )
    assert tuple(one.label for one in ledger.pieces) == whole.labels
    assert stream.fitness == pytest.approx((whole.fitness,), abs=1e-9)
    assert all(one.final for one in ledger.pieces)


def test_a_border_that_changes_its_mind_leaves_nothing_behind(case):
    """What is only probable is taken back: as if the right borders had come at once."""
    model, recording, bounds = case
    ends = bounds[:4, 1].tolist()
    pieces = []
    for wrong in ((), (ends[1] - 9,)):
        stream, frames = make_stream(model, recording)
        feed(frames, recording, 0, ends[-1] + 1)
        for guess in wrong:
            stream.update([[ends[0], guess]], 0, False)
        stream.update([ends], ends[-1], True)
        pieces.append(stream.ledgers[0].pieces)
    assert pieces[0] == pieces[1]


def test_an_action_in_which_a_marker_was_lost_is_unknown(case):
    model, recording, bounds = case
    stream, frames = make_stream(model, recording)
    end = int(bounds[-1, 1])
    feed(frames, recording, 0, 20, lost=("elbow",))
    feed(frames, recording, 20, end)
    changes = stream.update([bounds[:, 1].tolist()], end, True)
    first, *others = stream.ledgers[0].pieces
    assert (first.label, first.uncertainty) == ("unknown", np.inf)
    assert all(one.label != "unknown" for one in others)
    assert [change.status for change in changes] == ["final"] * (1 + len(others))
