"""Movements and rests of a stream are those of the whole recording."""

import numpy as np
import pytest
from places import REAL_DATA
from reaches import reach

from besman.exceptions import SegmentationError
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.stage import LabelConfig
from besman.stages.segment.sampling import gather_gapless_paths
from besman.stages.segment.stage import HAND_SHAPE, ValleyOnlineConfig, ValleyVmciConfig
from besman.stages.segment.valley_online import OnlineMovements, measure_pace, pool_paces
from besman.stages.segment.valley_vmci import find_movements


def follow(paths, rate_hz, pace, **options):
    """Return the borders, how long after each it was final, and all that were ever pending."""
    online = OnlineMovements(pace, rate_hz, **options)
    borders, delays, pending = [], [], []
    for k, sample in enumerate(paths):
        new = online.update(sample)
        borders += new
        delays += [(k + 1 - one) / rate_hz for one in new]
        pending.append(online.pending)
    return borders + online.finish(), delays, pending


@pytest.mark.parametrize("rate_hz", [47.3, 100.0, 240.0])
@pytest.mark.parametrize("pause_s", [0.0, 1.2])
def test_borders_are_those_of_the_whole_at_every_rate(rate_hz, pause_s):
    time, paths, _ = reach(3, n_moves=7, rate_hz=rate_hz, pause_s=pause_s)
    borders, delays, pending = follow(paths, rate_hz, measure_pace(time, paths))
    expected = np.round(find_movements(time, paths).borders_s[1:-1] * rate_hz)
    assert borders == expected.astype(int).tolist()
    # They were final while it went on, and most of them had been expected.
    assert len(delays) >= len(borders) - 4
    assert np.median(delays) < 3.0
    known = {one for some in pending for one in some}
    assert len(known & set(borders)) > len(borders) / 2


def test_a_long_stream_keeps_what_it_needs_alone():
    time, paths, _ = reach(1, n_moves=25, rate_hz=50.0)
    online = OnlineMovements(measure_pace(time, paths), 50.0)
    held = []
    for sample in paths:
        online.update(sample)
        held.append(len(online._samples))
    assert max(held) < 12.0 * 50 < len(paths) / 2


def test_a_long_rest_is_not_kept():
    time, paths, _ = reach(4, n_moves=3, rate_hz=50.0)
    long = [np.repeat(paths[at], 1500, axis=0) for at in ([0], [-1])]
    noise = np.random.default_rng(0).normal(scale=1e-4, size=(2, 1500, 1, 3))
    paths = np.concatenate([long[0] + noise[0], paths, long[1] + noise[1], paths[::-1]])
    time = np.arange(len(paths)) / 50.0
    online, borders, held = OnlineMovements(measure_pace(time, paths), 50.0), [], []
    for sample in paths:
        borders += online.update(sample)
        held.append(len(online._samples))
    borders += online.finish()
    expected = np.round(find_movements(time, paths).borders_s[1:-1] * 50.0)
    assert borders == expected.astype(int).tolist()
    assert max(held) < 20 * 50


def test_who_stirs_for_ever_is_cut(monkeypatch):
    monkeypatch.setattr("besman.stages.segment.valley_online._LONGEST_S", 3.0)
    t = np.arange(1200) / 50.0
    circle = 0.2 * np.stack([np.cos(3 * t), np.sin(3 * t), 0 * t], axis=1)[:, np.newaxis]
    online = OnlineMovements(measure_pace(t, circle), 50.0)
    held = []
    for sample in circle:
        online.update(sample)
        held.append(len(online._samples))
    assert max(held) < 700


def test_a_rest_is_final_within_a_second():
    time, paths, _ = reach(2, n_moves=3)
    still = np.concatenate([paths, np.repeat(paths[-1:], 150, axis=0)])
    borders, delays, _ = follow(still, 100.0, measure_pace(time, paths))
    last = borders[-1]
    assert abs(last - len(paths)) < 15
    assert delays[-1] <= 1.1
    assert len(delays) == len(borders)


@pytest.mark.skipif(not REAL_DATA.is_dir(), reason="no real recordings here")
def test_real_recordings_with_the_pace_of_another_person():
    marker_set = load_marker_set("right_arm")
    label = LabelConfig(longest_gap_s=1.0)

    def read(name):
        return label.run(
            (read_recording(REAL_DATA / "pick_and_place" / f"{name}.tsv"),), marker_set
        )

    others = [*read("subject1_run1"), *read("subject1_run4")]
    pace = pool_paces([ValleyOnlineConfig().measure(one) for one in others])
    (one,) = read("subject2_run5")
    paths = gather_gapless_paths(one, ("hand_top",))
    borders, delays, _ = follow(paths, one.rate_hz, pace, shape=HAND_SHAPE)
    assert borders == ValleyVmciConfig().run((one,))[0].bounds[1:, 0].tolist()
    assert np.median(delays) < 3.0


def test_what_cannot_be_segmented_is_said():
    time, paths, _ = reach(0, n_moves=1)
    pace = measure_pace(time, paths)
    with pytest.raises(SegmentationError, match=r"sample 0: expected 1 finite positions of shape"):
        OnlineMovements(pace, 100.0).update(np.full((1, 3), np.nan))
    with pytest.raises(SegmentationError, match="rates must be positive, got 0 Hz"):
        OnlineMovements(pace, 0.0)
    with pytest.raises(SegmentationError, match="the pace comes from markers that do not move"):
        OnlineMovements(measure_pace(time, np.zeros_like(paths)), 100.0)
    online = OnlineMovements(pace, 100.0)
    with pytest.raises(SegmentationError, match="a segmentation needs at least 2 samples, got 0"):
        online.finish()
    online.update(paths[0])
    online.update(paths[1])
    assert online.finish() == []
    with pytest.raises(SegmentationError, match="the segmentation is finished; start a new one"):
        online.update(paths[2])
