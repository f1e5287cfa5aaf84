import numpy as np
import pytest

from besman.annotate.signals import CHUNK, FACTOR, Pyramid, SignalPyramids
from besman.exceptions import WebError
from besman.records import Recording
from besman.stages.label.joined_trajectories import WovenRecording


@pytest.fixture
def positions():
    rng = np.random.default_rng(0)
    x = np.cumsum(rng.normal(size=(20_011, 2, 3)), axis=0) * 1e-3
    x[500:5000, 1] = np.nan
    return x


def signals_of(positions):
    names = (None,) * positions.shape[1]
    recording = Recording(np.arange(len(positions)) / 100, positions, names, 100.0, "a.tsv")
    return SignalPyramids(WovenRecording.of(recording))


@pytest.fixture
def signals(positions):
    return signals_of(positions)


def test_every_level_holds_least_and_greatest_value(positions):
    values = positions[:, 1].T
    pyramid = Pyramid(lambda start, stop: values[:, start:stop].astype(np.float32), 20_011)
    assert pyramid.n_levels == 3
    for level in range(1, pyramid.n_levels):
        step = FACTOR**level
        found = pyramid.chunk(level, 0)
        for k in range(found.shape[1]):
            stretch = values[:, k * step : (k + 1) * step].astype(np.float32)
            if np.isnan(stretch).all():
                assert np.isnan(found[:, k]).all()
            else:
                np.testing.assert_array_equal(found[:, k, 0], np.nanmin(stretch, axis=1))
                np.testing.assert_array_equal(found[:, k, 1], np.nanmax(stretch, axis=1))


def test_pieces_put_together_are_the_recording(signals, positions):
    n_pieces = -(-len(positions) // CHUNK)
    whole = np.concatenate([signals.frames(k) for k in range(n_pieces)])
    np.testing.assert_array_equal(whole, positions.astype(np.float32))
    one = np.concatenate([signals.chunk("positions", 1, 0, k) for k in range(n_pieces)], axis=1)
    np.testing.assert_array_equal(one, positions[:, 1].T.astype(np.float32))


def test_sketch_is_every_nth_sample(signals, positions):
    sketch, step = signals.sketch()
    assert len(sketch) <= CHUNK
    np.testing.assert_array_equal(sketch, positions[::step].astype(np.float32))


def test_speed_of_a_steady_movement_is_its_speed():
    t = np.arange(300) / 100
    positions = np.stack([np.outer(t, [3.0, 0, 4.0]), np.outer(t, [0, 1.0, 0])], axis=1)
    signals = signals_of(positions)
    speeds = signals.chunk("speeds", 0, 0, 0)
    np.testing.assert_allclose(speeds[0], 5.0, rtol=1e-4)
    np.testing.assert_allclose(speeds[2], 6.0, rtol=1e-4)
    np.testing.assert_allclose(signals.chunk("velocities", 0, 0, 0)[2], 4.0, rtol=1e-4)


def test_sum_does_not_fall_where_a_marker_is_hidden():
    t = np.arange(300) / 100
    positions = np.stack([np.outer(t, [1.0, 0, 0])] * 2, axis=1)
    positions[100:200, 1] = np.nan
    total = signals_of(positions).chunk("speeds", 0, 0, 0)[-1]
    np.testing.assert_allclose(total, 2.0, rtol=1e-4)
    positions[100:200] = np.nan
    total = signals_of(positions).chunk("speeds", 0, 0, 0)[-1]
    assert np.isnan(total[110:190]).all()


@pytest.mark.parametrize("n_samples", [3, 40, 9000])
def test_pieces_of_velocities_and_speeds_are_those_of_the_whole(n_samples):
    rng = np.random.default_rng(1)
    positions = np.cumsum(rng.normal(size=(n_samples, 3, 3)), axis=0)
    positions[rng.random((n_samples, 3)) < 0.3] = np.nan
    signals, x = signals_of(positions), positions.astype(np.float32)
    rows = np.arange(n_samples)
    after, before = np.minimum(rows + 2, n_samples - 1), np.maximum(rows - 2, 0)
    span = (after / 100 - before / 100).astype(np.float32)
    velocities = (x[after] - x[before]) / span[:, None, None]
    speeds = np.sqrt((velocities**2)[..., 0] + (velocities**2)[..., 1] + (velocities**2)[..., 2])
    n_pieces = -(-n_samples // CHUNK)
    for group, whole in (("velocities", velocities[:, 1].T), ("speeds", speeds.T)):
        pieces = [signals.chunk(group, 1, 0, k) for k in range(n_pieces)]
        found = np.concatenate(pieces, axis=1)[: len(whole)]
        np.testing.assert_array_equal(found, whole)
    total = np.concatenate([signals.chunk("speeds", 0, 0, k)[-1] for k in range(n_pieces)])
    seen = np.isfinite(speeds).sum(axis=1)
    mean = np.nansum(speeds, axis=1) / np.maximum(seen, 1)
    np.testing.assert_allclose(total, np.where(seen, 3 * mean, np.nan), rtol=1e-5)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (("sounds", 0, 0, 0), "no group of signals 'sounds'"),
        (("positions", 2, 0, 0), "no marker 2; expected 0 to 1"),
        (("positions", 0, 9, 0), "no piece 0 of level 9; there are 3 levels"),
        (("positions", 0, 0, 99), "no piece 99 of level 0"),
    ],
)
def test_what_is_not_there_is_said(signals, ask, message):
    with pytest.raises(WebError, match=message):
        signals.chunk(*ask)
