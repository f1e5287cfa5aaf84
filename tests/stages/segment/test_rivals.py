import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import SegmentationError
from besman.records import LabelledRecording
from besman.stages.segment.locmin import find_speed_minima
from besman.stages.segment.mci import find_position_changes
from besman.stages.segment.rivals import BpArHmmConfig, LocminConfig, MciConfig, ProbsConfig
from besman.stages.segment.vmci_plain import find_change_points_plainly
from besman.synthetic.sequenced_dmps import generate_sequenced_dmps

CONFIGS = (MciConfig(), LocminConfig(), BpArHmmConfig(sweeps=10), ProbsConfig(most_primitives=2))


def record(positions, rate_hz=100.0, source="a.tsv"):
    paths = np.asarray(positions, dtype=float)[:, np.newaxis]
    time = np.arange(len(paths)) / rate_hz
    return LabelledRecording(
        time, paths, ("hand_top",), np.zeros(paths.shape[:2], bool), rate_hz, source
    )


def test_mci_is_vmci_without_bells():
    y = np.cumsum(np.random.default_rng(0).normal(size=(60, 3)), axis=0)
    fast = find_position_changes(y, 0.05)
    plain = find_change_points_plainly(y, np.empty((60, 0)), 0.05)
    np.testing.assert_array_equal(fast.borders, plain.borders)
    assert fast.log_probability == pytest.approx(plain.log_probability + np.log(3), abs=3)


@settings(deadline=None)
@given(st.lists(st.integers(0, 5), min_size=2, max_size=40).map(np.array), st.integers(1, 4))
def test_minima_are_the_lowest_of_their_window(speed, half):
    borders = find_speed_minima(speed, half)
    assert borders[0] == 0
    assert borders[-1] == len(speed)
    assert (np.diff(borders) > 0).all()
    for border in borders[1:-1]:
        window = speed[border - half : border + half + 1]
        assert len(window) == 2 * half + 1


def test_minima_by_hand():
    np.testing.assert_array_equal(find_speed_minima([3, 1, 3, 3, 0, 0, 0, 3, 3], 1), [0, 1, 5, 9])
    np.testing.assert_array_equal(find_speed_minima([3, 1, 3, 3, 0, 0, 0, 3, 3], 3), [0, 5, 9])
    np.testing.assert_array_equal(find_speed_minima(np.ones(9), 2), [0, 9])


def test_bad_speeds_are_refused():
    with pytest.raises(SegmentationError, match="half a window has 0 samples"):
        find_speed_minima([1.0, 2.0], 0)
    with pytest.raises(SegmentationError, match=r"must have shape \(T,\), T >= 2"):
        find_speed_minima([1.0], 1)
    with pytest.raises(SegmentationError, match="finite; sample 1"):
        find_speed_minima([1.0, np.nan], 1)


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: config.method)
def test_what_every_rival_does(config):
    recordings = tuple(movement.recording() for movement in generate_sequenced_dmps()[:3])
    shares = []
    segments = config.run(recordings)
    for found, recording in zip(segments, recordings, strict=True):
        assert found.bounds[0, 0] == 0
        assert found.bounds[-1, 1] == len(recording.time)
        np.testing.assert_array_equal(found.bounds[1:, 0], found.bounds[:-1, 1])
        assert (np.diff(found.bounds, axis=1) > 0).all()
        assert found.source == recording.source
    again = config.run(recordings)
    assert all(
        a.bounds.tobytes() == b.bounds.tobytes() for a, b in zip(segments, again, strict=True)
    )
    from besman.config.stage import Work

    config.run(recordings, Work(progress=shares.append))
    assert shares[-1] == 1.0


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: config.method)
def test_bad_recordings(config):
    still = record(np.full((100, 3), 0.3))
    (segments,) = config.run((still,))
    np.testing.assert_array_equal(segments.bounds, [[0, 100]])
    steady = record(np.arange(100.0)[:, None] * [0.01, 0.0, 0.0])
    assert config.run((steady,))[0].bounds[-1, 1] == 100
    gap = np.random.default_rng(0).normal(size=(100, 3))
    gap[4] = np.nan
    with pytest.raises(SegmentationError, match="'hand_top' was not seen in frame 5"):
        config.run((record(gap),))
    with pytest.raises(SegmentationError, match="got 1 samples; expected at least 2"):
        config.run((record(np.zeros((1, 3))),))


@pytest.mark.parametrize("config", CONFIGS[2:], ids=lambda config: config.method)
def test_clusters_have_names_and_one_rate(config):
    recordings = tuple(movement.recording() for movement in generate_sequenced_dmps()[:3])
    labelled = config.run_labelled(recordings)
    assert all(each.labels[0].startswith("cluster") for each in labelled)
    slow = record(np.random.default_rng(0).normal(size=(50, 3)), rate_hz=10.0)
    with pytest.raises(SegmentationError, match="recordings come at 10, 20 Hz"):
        config.run((*recordings, slow))
