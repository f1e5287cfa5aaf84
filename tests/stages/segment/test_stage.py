from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import REAL_DATA
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from besman.exceptions import LabellingError, SegmentationError
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.segment.scores import manual_borders, mean_score
from besman.stages.segment.stage import SegmentConfig


def record(positions, rate_hz=60.0, first_frame=1):
    time = (first_frame - 1 + np.arange(len(positions))) / rate_hz
    paths = np.asarray(positions, dtype=float)[:, np.newaxis]
    filled = np.zeros(paths.shape[:2], dtype=bool)
    return LabelledRecording(time, paths, ("hand_top",), filled, rate_hz, "a.tsv", first_frame)


def reach(seed=0, n_moves=5, rate_hz=60.0):
    """Reaches of about a second between random points, with minimum jerk."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(scale=0.3, size=(n_moves + 1, 3)), axis=0)
    pieces, borders = [], [0]
    for start, goal in pairwise(points):
        n = int(rate_hz * rng.uniform(0.8, 1.3))
        s = np.arange(n) / n
        pieces.append(start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis])
        borders.append(borders[-1] + n)
    path = np.concatenate(pieces)
    return path + rng.normal(scale=2e-4, size=path.shape), np.array(borders)


def test_reaches_are_found():
    path, borders = reach()
    (segments,) = SegmentConfig().run((record(path),))
    found = np.unique(segments.bounds)
    assert len(found) == len(borders)
    assert np.abs(found - borders).max() <= 12
    assert np.isfinite(segments.log_evidence)


def test_segments_cover_the_recording_at_its_own_rate():
    path, _ = reach(1, rate_hz=100.0)
    recording = record(path, 100.0, first_frame=690)
    (segments,) = SegmentConfig(rate_hz=30.0).run((recording,))
    np.testing.assert_array_equal(segments.bounds[1:, 0], segments.bounds[:-1, 1])
    assert segments.bounds[0, 0] == 0
    assert segments.bounds[-1, 1] == len(path)
    assert (segments.rate_hz, segments.source, segments.first_frame) == (100.0, "a.tsv", 690)


def test_a_recording_slower_than_the_rate_is_taken_as_it_is():
    path, _ = reach(2, rate_hz=15.0)
    slow = SegmentConfig(rate_hz=15.0).run((record(path, 15.0),))[0]
    fast = SegmentConfig(rate_hz=100.0).run((record(path, 15.0),))[0]
    np.testing.assert_array_equal(slow.bounds, fast.bounds)


def test_no_segment_is_longer_than_asked_for():
    path, _ = reach(3)
    (segments,) = SegmentConfig(longest_s=0.6).run((record(path),))
    assert np.diff(segments.bounds, axis=1).max() <= 0.6 * 60 + 3


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 50), st.floats(1e-3, 1e3), st.integers(0, 100))
def test_borders_do_not_depend_on_place_axes_or_unit(seed, unit, turn_seed):
    path, _ = reach(seed, n_moves=3)
    turn = Rotation.random(rng=np.random.default_rng(turn_seed)).as_matrix()
    moved = unit * (path @ turn.T + [3.0, -2.0, 1.0])
    one, other = SegmentConfig().run((record(path), record(moved)))
    np.testing.assert_array_equal(one.bounds, other.bounds)
    assert np.all(np.diff(np.unique(one.bounds)) > 0)


def test_the_same_input_gives_the_same_bytes():
    path, _ = reach(4)
    one, other = (SegmentConfig().run((record(path),))[0] for _ in range(2))
    assert one.bounds.tobytes() == other.bounds.tobytes()
    assert one.log_evidence == other.log_evidence


def test_a_person_who_stands_still_is_one_segment():
    (segments,) = SegmentConfig().run((record(np.full((100, 3), 0.4)),))
    np.testing.assert_array_equal(segments.bounds, [[0, 100]])
    assert np.isnan(segments.log_evidence)


def test_steady_movement_has_borders():
    steady = np.arange(120.0)[:, np.newaxis] * [0.01, 0.0, 0.0]
    (segments,) = SegmentConfig().run((record(steady),))
    assert segments.bounds[-1, 1] == 120


def test_a_gap_is_refused_with_marker_and_frame():
    path, _ = reach()
    path[17] = np.nan
    with pytest.raises(SegmentationError, match="'hand_top' was not seen in frame 117"):
        SegmentConfig().run((record(path, first_frame=100),))


def test_too_short_recordings_are_refused():
    with pytest.raises(SegmentationError, match=r"a.tsv: got 1 samples; expected at least 2"):
        SegmentConfig().run((record(np.zeros((1, 3))),))
    with pytest.raises(SegmentationError, match=r"a.tsv: lasts 0.03.* s, which is 1 sample at 20"):
        SegmentConfig().run((record(np.eye(2, 3)),))


def test_a_marker_that_is_not_there_is_refused():
    with pytest.raises(LabellingError, match="no marker 'hand_tip'; did you mean 'hand_top'"):
        SegmentConfig(markers=("hand_tip",)).run((record(reach()[0]),))


def test_config_is_checked():
    with pytest.raises(ValidationError, match="greater than 0"):
        SegmentConfig(rate_hz=0)
    with pytest.raises(ValidationError, match="greater than or equal to 1"):
        SegmentConfig(n_centres=0)


def test_progress_is_reported():
    from besman.config.stage import Work

    shares = []
    SegmentConfig().run((record(reach()[0]),) * 2, work=Work(progress=shares.append))
    assert shares == [0.5, 1.0]


@pytest.fixture(scope="module")
def real():
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    from besman.io.recordings.qtm_tsv import read_tsv
    from besman.io.segments_json import read_segments, segments_path

    recordings, truth = [], []
    for path in sorted(folder.glob("*.tsv")):
        raw = read_tsv(path)
        hand = [name.lower() for name in raw.names].index("hand top")
        positions = raw.positions[:, hand : hand + 1]
        filled = np.zeros(positions.shape[:2], dtype=bool)
        recordings.append(
            LabelledRecording(
                raw.time, positions, ("hand_top",), filled, raw.rate_hz, raw.source, raw.first_frame
            )
        )
        segments = read_segments(segments_path(path), raw)
        assert isinstance(segments, LabelledSegments)
        truth.append(segments)
    return tuple(recordings), tuple(truth)


def test_real_recordings_have_the_number_of_manual_segments_that_is_known(real):
    assert sum(len(manual_borders(truth)) - 1 for truth in real[1]) == 96


def test_real_recordings_are_segmented_as_well_as_published(real):
    recordings, truth = real
    segments = SegmentConfig().run(recordings)
    inner = mean_score(segments, truth)
    assert inner.f1 > 0.64
    assert inner.fp < 3.0
    assert mean_score(segments, truth, count_end=True).f1 > 0.67
