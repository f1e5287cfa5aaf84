"""Names at one instant, of the embedded recording whose names were taken away."""

import numpy as np
import pytest

from besman.stages.label.anchor import _compare_sides, choose_anchor_frames, find_anchor
from besman.stages.label.fragments import measure_pairs, split_fragments
from besman.stages.label.scores import ScoreWeights
from besman.stages.label.trajectories import learn_from_recording


def test_frames_are_those_where_most_is_seen_for_long():
    rng = np.random.default_rng(2)
    positions = rng.normal(size=(90, 8, 3))
    positions[rng.random((90, 8)) < 0.15] = np.nan
    fragments = split_fragments(positions, 50.0)
    worth = np.zeros(90)
    for k in range(fragments.n_fragments):
        seconds = (fragments.stop[k] - fragments.start[k]) / 50.0
        worth[fragments.start[k] : fragments.stop[k]] += min(seconds, 2.0) + 0.2
    frames = choose_anchor_frames(fragments, 8, 3)
    assert sorted(frames // 30) == [0, 1, 2]
    for frame in frames:
        begin = 30 * (frame // 30)
        assert worth[frame] == pytest.approx(worth[begin : begin + 30].max())
    assert (np.diff(worth[frames]) <= 1e-12).all()


def test_a_stretch_that_shows_nothing_has_no_frame():
    positions = np.random.default_rng(3).normal(size=(1, 4, 3)).repeat(90, axis=0)
    positions[:30] = np.nan
    frames = choose_anchor_frames(split_fragments(positions, 50.0), 8, 3)
    assert sorted(frames // 30) == [1, 2]
    nobody = split_fragments(np.full_like(positions, np.nan), 50.0)
    assert choose_anchor_frames(nobody, 8, 3).shape == (0,)


@pytest.mark.parametrize("hidden", [(), (2, 5)])
def test_all_markers_of_an_instant_are_named(clean, teacher, marker_set, hidden):
    model = learn_from_recording(teacher, marker_set)
    positions = clean.recording.positions[:300].copy()
    gone = [column for column in range(positions.shape[1]) if clean.truth[0][column] in [
        model.markers[marker] for marker in hidden
    ]]  # fmt: skip
    positions[:, gone] = np.nan
    fragments = split_fragments(positions, clean.recording.rate_hz)
    anchor = find_anchor(fragments, measure_pairs(fragments), model, ScoreWeights(), 150)
    named = {
        clean.truth[0][fragments.column[k]]: model.markers[label]
        for k, label in zip(anchor.fragments, anchor.markers, strict=True)
    }
    assert anchor.frame == 150
    assert len(named) == positions.shape[1] - len(hidden)
    assert all(truth == name for truth, name in named.items())


def test_sides_are_those_of_all_logarithms_to_the_last_bit():
    rng = np.random.default_rng(3)
    pull = np.concatenate(
        [rng.normal(scale=s, size=2000) for s in (0.1, 5.0, 30.0)]
        + [[-8.7, 38.0, np.inf, -np.inf, 0.0, -0.0]]
        + [[np.nextafter(x, y) for x in (-8.7, 38.0) for y in (-99, 99)]]
    )
    seen = rng.random(len(pull)) < 0.8
    every = np.maximum(np.log(2.0) - np.logaddexp(0.0, -pull), -8.0)
    np.testing.assert_array_equal(_compare_sides(pull, seen), np.where(seen, every, 0.0))
