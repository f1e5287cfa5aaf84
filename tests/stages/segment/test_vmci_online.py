import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import SegmentationError
from besman.stages.segment import vmci_online
from besman.stages.segment.signals import measure_scaling, prepare_signals, resample
from besman.stages.segment.vmci import find_change_points, merge_single_samples
from besman.stages.segment.vmci_online import OnlineVmci


def walk(seed, n_samples, n_markers=1):
    rng = np.random.default_rng(seed)
    steps = np.cumsum(rng.normal(size=(n_samples, n_markers, 3)), axis=0)
    steps *= np.abs(np.sin(np.arange(n_samples) / rng.uniform(5, 15)))[:, np.newaxis, np.newaxis]
    return np.cumsum(steps, axis=0) * 1e-3


def whole(paths, sample_rate_hz, rate_hz, longest_s, p):
    """The borders of the whole recording, as numbers of samples given, without both ends."""
    rate_hz = min(rate_hz, sample_rate_hz)
    samples = resample(np.arange(len(paths)) / sample_rate_hz, paths, rate_hz)
    signals = prepare_signals(samples)
    longest = max(2, round(longest_s * rate_hz))
    found = find_change_points(signals.positions, signals.speeds, p, longest)
    borders = merge_single_samples(found.borders)[1:-1]
    ratio = sample_rate_hz / rate_hz
    return np.round(borders * ratio).astype(int).tolist(), measure_scaling(samples)


@settings(deadline=None, max_examples=30)
@given(
    st.integers(0, 10_000),
    st.integers(30, 300),
    st.sampled_from([(20.0, 20.0), (60.0, 20.0), (100.0, 30.0), (15.0, 20.0)]),
    st.sampled_from([1.5, 5.0]),
    st.integers(1, 2),
)
def test_borders_are_those_of_the_whole_recording(seed, n_samples, rates, longest_s, n_markers):
    paths = walk(seed, n_samples, n_markers)
    expected, scaling = whole(paths, *rates, longest_s, 0.05)
    found = []
    with pytest.MonkeyPatch.context() as patch:
        # Without giving up starts, which no bound covers for any data.
        patch.setattr(vmci_online, "_LEAD", np.inf)
        online = OnlineVmci(scaling, 0.05, *rates, longest_s)
        for sample in paths:
            new = online.update(sample)
            assert not set(new) & set(found)
            found += new
        pending = online.pending
        found += online.finish()
    assert found == expected
    assert found == sorted(found)
    assert all(0 < border < n_samples for border in pending)


def test_borders_come_before_the_end():
    paths = walk(1, 2000)
    _, scaling = whole(paths, 20.0, 20.0, 2.0, 0.05)
    online = OnlineVmci(scaling, 0.05, 20.0, 20.0, 2.0)
    delays = []
    for index, sample in enumerate(paths):
        delays += [index + 1 - border for border in online.update(sample)]
    assert len(delays) > 20
    assert np.median(delays) < 400


def test_memory_stays_bounded_even_if_the_ways_do_not_meet(monkeypatch):
    monkeypatch.setattr(vmci_online, "_MEMORY", 3)
    paths = walk(2, 1500)
    _, scaling = whole(paths, 20.0, 20.0, 1.0, 0.05)
    online = OnlineVmci(scaling, 0.05, 20.0, 20.0, 1.0)
    sizes = {array.size for array in vars(online).values() if isinstance(array, np.ndarray)}
    found = [border for sample in paths for border in online.update(sample)] + online.finish()
    after = {array.size for array in vars(online).values() if isinstance(array, np.ndarray)}
    assert sizes == after
    assert found == sorted(found)
    # Cut at a second at most, and whole: no border is lost where a way was taken for good.
    assert np.diff([0, *found, 1500]).max() <= 21


def test_what_cannot_be_segmented_is_refused():
    _, scaling = whole(walk(0, 50), 20.0, 20.0, 1.0, 0.05)
    online = OnlineVmci(scaling, 0.05, 20.0)
    with pytest.raises(SegmentationError, match=r"sample 0: expected 1 finite positions"):
        online.update(np.full((1, 3), np.nan))
    with pytest.raises(SegmentationError, match=r"shape \(1, 3\), got"):
        online.update(np.zeros((2, 3)))
    with pytest.raises(SegmentationError, match="at least 2 samples at 20 Hz, got 0"):
        online.finish()
    for sample in walk(0, 5):
        online.update(sample)
    online.finish()
    with pytest.raises(SegmentationError, match="finished; start a new one"):
        online.update(np.zeros((1, 3)))
    still = measure_scaling(np.ones((10, 1, 3)))
    with pytest.raises(SegmentationError, match="markers that do not move"):
        OnlineVmci(still, 0.05, 20.0)
    with pytest.raises(SegmentationError, match="rates must be positive, got 0 Hz"):
        OnlineVmci(scaling, 0.05, 0.0)
