import numpy as np
import plain_valleys
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import REAL_DATA
from plain_valleys import evaluate_all, search, weigh
from reaches import reach
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from besman.io.recordings.formats import read_recording
from besman.stages.segment import long_spans, spans, valley_vmci
from besman.stages.segment.signals import prepare_signals, resample
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.valley_vmci import find_movements
from besman.stages.segment.vmci import VmciModel, tabulate_lengths
from besman.stages.segment.vmci_plain import evaluate_segments


@pytest.mark.parametrize("rate_hz", [20.0, 60.0, 100.0, 250.0, 500.0])
@pytest.mark.parametrize("pause_s", [0.0, 0.8])
def test_movements_and_rests_are_found_at_every_rate(rate_hz, pause_s):
    for seed in range(3):
        time, paths, borders = reach(seed, rate_hz=rate_hz, pause_s=pause_s)
        found = find_movements(time, paths)
        assert len(found.borders_s) == len(borders)
        np.testing.assert_allclose(found.borders_s, borders, rtol=0, atol=0.12)
        assert found.rests.tolist() == [
            bool(pause_s) and k % 2 == 1 for k in range(len(borders) - 1)
        ]
        assert np.isfinite(found.log_probability)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 50), st.floats(1e-3, 1e3), st.integers(0, 100))
def test_borders_do_not_depend_on_place_axes_or_unit(seed, unit, turn_seed):
    time, paths, _ = reach(seed, n_moves=3)
    turn = Rotation.random(rng=np.random.default_rng(turn_seed)).as_matrix()
    one = find_movements(time, paths)
    other = find_movements(time, unit * (paths @ turn.T + [3.0, -2.0, 1.0]))
    np.testing.assert_array_equal(one.borders_s, other.borders_s)
    assert np.all(np.diff(one.borders_s) > 0)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.integers(2, 300), st.sampled_from([20.0, 60.0, 137.0]))
def test_borders_of_noise_are_sorted_and_inside(seed, n_samples, rate_hz):
    rng = np.random.default_rng(seed)
    paths = np.cumsum(rng.normal(size=(n_samples, 1, 3)), axis=0)
    found = find_movements(np.arange(n_samples) / rate_hz, paths)
    assert found.borders_s[0] == 0
    assert found.borders_s[-1] == pytest.approx(n_samples / rate_hz)
    assert np.all(np.diff(found.borders_s) > 0)
    assert len(found.rests) == len(found.borders_s) - 1
    assert np.all((found.candidate_probability >= 0) & (found.candidate_probability <= 1))


def test_nothing_moves():
    found = find_movements(np.arange(50) / 60, np.full((50, 1, 3), 0.3))
    assert found.borders_s.tolist() == [0.0, pytest.approx(50 / 60)]
    assert np.isnan(found.log_probability)


def test_rests_at_the_ends_are_segments():
    _, paths, borders = reach(3)
    still = np.ones((150, 1, 1))
    longer = np.concatenate([paths[0] * still, paths, paths[-1] * still])
    found = find_movements(np.arange(len(longer)) / 100, longer)
    np.testing.assert_allclose(found.borders_s[1:-1], borders + 1.5, rtol=0, atol=0.12)
    assert found.rests.tolist() == [True] + [False] * (len(borders) - 1) + [True]
    assert found.borders_s[-1] == len(longer) / 100


def test_one_of_two_markers_may_stand_still():
    time, paths, borders = reach(1)
    still = np.concatenate([paths, np.ones_like(paths)], axis=1)
    assert len(find_movements(time, still).borders_s) == len(borders)


def test_spans_have_the_evidence_of_vmci():
    time, paths, _ = reach(2)
    v = prepare_signals(resample(time, paths, 20.0)).speeds
    v = np.concatenate([v, 0.7 * np.roll(v, 1, axis=0) + 0.2], axis=1)
    model = VmciModel(n_centres=4)
    factor = tabulate_lengths(len(v), 0, 2, 0.05, None, model)
    plain = factor + evaluate_segments(np.empty((len(v), 0)), v, len(v), model)
    evidence = SpanEvidence(v, factor, model)
    starts, ends = np.array([0, 11, 11, 30, 30, 0]), np.array([9, 30, 31, 60, 61, len(v)])
    found = evidence.evaluate(starts, ends)
    assert found == pytest.approx(plain[ends, ends - starts], abs=1e-7)
    assert np.isfinite(found).any()
    assert np.isinf(evidence.evaluate(starts, np.minimum(starts + 1, ends))).all()
    few = evidence._replace(factor=factor[:20]).evaluate(starts, ends)
    np.testing.assert_array_equal(few, np.where(ends - starts < 20, found, -np.inf))


class PlainWays:
    """All pairs of valleys, as the equations say."""

    def __init__(self, evidence, starts, ends, rest, sure, given):
        self.rest = rest
        self.movement = evaluate_all(evidence, starts, ends, sure, given)
        self.best, self.log_probability = search(self.movement, rest)

    def weigh(self):
        return weigh(self.movement, self.rest)


def compare_with_all_pairs(monkeypatch, time, paths, longest_s=None):
    """Segment as it is done and by all pairs of valleys, these found one by one."""
    found = find_movements(time, paths, longest_s)
    with monkeypatch.context() as patch:
        patch.setattr(valley_vmci, "Spans", lambda *arguments: arguments)
        patch.setattr(valley_vmci, "Ways", lambda arguments: PlainWays(*arguments))
        patch.setattr(valley_vmci, "find_valleys", plain_valleys.find_valleys)
        plain = find_movements(time, paths, longest_s)
    np.testing.assert_array_equal(found.candidates_s, plain.candidates_s)
    np.testing.assert_array_equal(found.borders_s, plain.borders_s)
    np.testing.assert_array_equal(found.rests, plain.rests)
    assert found.log_probability == pytest.approx(plain.log_probability, abs=1e-6)
    np.testing.assert_allclose(
        found.candidate_probability, plain.candidate_probability, rtol=0, atol=1e-4
    )
    return found


def stir(seed, duration_s, rate_hz, minor, variation):
    """An ellipse that is drawn again and again: no rest, and few sure valleys."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(100 * duration_s)) / 100
    slow = [gaussian_filter1d(rng.normal(size=len(t)), 70) * 13 for _ in range(2)]
    phase = np.cumsum(2 * np.pi * rate_hz * np.exp(variation * slow[0])) / 100
    size = 0.15 * np.exp(variation * slow[1])
    path = np.stack([size * np.cos(phase), minor * size * np.sin(phase), 0 * t], axis=1)
    return t, (path + rng.normal(scale=2e-4, size=path.shape))[:, np.newaxis]


@pytest.mark.parametrize(
    ("rate_hz", "minor", "variation"),
    [(0.5, 0.42, 0.05), (1.0, 0.35, 0.2), (1.5, 0.35, 0.02), (2.0, 0.4, 0.3)],
)
@pytest.mark.parametrize("n_hands", [1, 2])
def test_continuous_movement_has_the_borders_of_all_pairs(
    monkeypatch, rate_hz, minor, variation, n_hands
):
    # Movements are long from 64 samples on.
    monkeypatch.setattr(long_spans, "_LEAST_WIDTH", 16)
    for module in (long_spans, spans):
        monkeypatch.setattr(module, "REACH", 32)
    time, paths = stir(1, 16.0, rate_hz, minor, variation)
    if n_hands == 2:
        paths = np.concatenate([paths, stir(2, 16.0, 1.1 * rate_hz, minor, variation)[1]], axis=1)
    compare_with_all_pairs(monkeypatch, time, paths)


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 10_000),
    st.floats(4.0, 15.0),
    st.floats(0.05, 0.5),
    st.integers(1, 3),
    st.one_of(st.none(), st.floats(0.5, 20.0)),
)
def test_smooth_noise_has_the_borders_of_all_pairs(seed, duration_s, smooth_s, n_axes, longest_s):
    rng = np.random.default_rng(seed)
    n = round(100 * duration_s)
    paths = np.zeros((n, 1, 3))
    paths[:, 0, :n_axes] = gaussian_filter1d(rng.normal(size=(n, n_axes)), 100 * smooth_s, axis=0)
    with pytest.MonkeyPatch.context() as patch:
        compare_with_all_pairs(patch, np.arange(n) / 100, paths, longest_s)


@pytest.mark.parametrize("pause_s", [0.0, 0.8])
def test_reaches_have_the_borders_of_all_pairs(monkeypatch, pause_s):
    time, paths, borders = reach(4, n_moves=12, pause_s=pause_s)
    assert len(compare_with_all_pairs(monkeypatch, time, paths).borders_s) == len(borders)


def test_real_recordings_have_the_borders_of_all_pairs(monkeypatch):
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    for path in sorted(folder.glob("*.tsv")):
        recording = read_recording(path)
        paths = recording.positions[:, [recording.names.index("Hand top")]].copy()
        seen = np.isfinite(paths).all(axis=(1, 2))
        row = np.arange(len(paths))
        for axis in range(3):
            paths[:, 0, axis] = np.interp(row, row[seen], paths[seen, 0, axis])
        compare_with_all_pairs(monkeypatch, recording.time, paths)


@pytest.mark.parametrize("n_movements", [3, 12])
def test_no_movement_leads_past_a_deep_valley(n_movements):
    x = np.linspace(0, 1, 61)[:-1]
    reach = 10 * x**3 - 15 * x**4 + 6 * x**5
    way = np.concatenate([k + reach for k in range(n_movements)])
    paths = np.stack([way, 0 * way, 0 * way], axis=1)[:, None]
    found = find_movements(np.arange(len(way)) / 100, paths)
    np.testing.assert_allclose(found.borders_s, 0.6 * np.arange(n_movements + 1), atol=0.03)
