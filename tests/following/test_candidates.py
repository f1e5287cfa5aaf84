"""Where actions may begin and end while the recording runs, and which borders are steady."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.following.candidates import CandidateStream
from besman.following.frames import FrameBuffer
from besman.following.steadiness import SteadyBorders
from besman.records import LabelledRecording
from besman.stages.compose.borders import candidate_borders, measure_brisk
from besman.stages.label.hold_last_sighting import HeldSample


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([10.0, 60.0, 100.0]), st.booleans())
def test_candidates_are_those_of_the_whole_recording(seed, rate_hz, with_hands):
    rng = np.random.default_rng(seed)
    n = 400
    path = np.cumsum(rng.normal(size=(n, 2, 3)) * rng.choice([0, 0.1, 1.0], n)[:, None, None], 0)
    names = ("hand_top", "left_hand_top")
    recording = LabelledRecording(
        np.arange(n) / rate_hz, path, names, np.zeros((n, 2), dtype=bool), rate_hz, "stream"
    )
    hands = names if with_hands else ()
    per_arm = [np.unique([0, *rng.integers(1, n, 25), n]) for _ in range(2)]
    frames = FrameBuffer(names, rate_hz, "stream", 1)
    stream = CandidateStream({hand: measure_brisk([recording], hand) for hand in hands}, frames)
    found = [0]
    for row in range(n):
        frames.add(HeldSample(path[row], np.zeros(2, dtype=bool), np.zeros(2, dtype=bool)))
        stream.add(path[row])
        # All borders so far are known, and final 50 rows later.
        after = stream.final_border
        present = [[b for b in rows.tolist() if after < b <= row] for rows in per_arm]
        final = min(max(b for b in (*rows, 0) if b <= max(0, row - 50)) for rows in per_arm)
        rows, n_final = stream.update(present, int(final), False)
        found += rows[:n_final]
    stream.finish()
    present = [[b for b in rows.tolist() if b > stream.final_border] for rows in per_arm]
    found += stream.update(present, n, True)[0]
    assert found == candidate_borders(recording, per_arm, hands).tolist()


def test_a_border_passes_once_it_and_all_before_it_are_steady():
    steady = SteadyBorders(3)
    assert [steady.update([10], 0, now) for now in (12, 13, 14)] == [[], [], []]
    assert steady.update([10, 13], 0, 15) == [10]
    # Another place: the old one stays until the new one is steady, or none is for as long.
    assert [steady.update([11], 0, now) for now in (16, 17, 18)] == [[10], [10], [10]]
    assert steady.update([11], 0, 19) == [11]
    assert [steady.update([], 0, now) for now in (20, 21, 22)] == [[11], [11], [11]]
    assert steady.update([], 0, 23) == []


def test_a_final_border_takes_its_place():
    steady = SteadyBorders(2)
    for now in (30, 31, 32):
        shown = steady.update([10, 20], 0, now)
    assert shown == [10, 20]
    assert steady.update([20], 10, 33) == [20]
    assert steady.update([], 19, 34) == []


def test_without_patience_all_passes():
    steady = SteadyBorders(0)
    assert [steady.update(rows, 0, 9) for rows in ([2], [2, 5], [3])] == [[2], [2, 5], [3]]
