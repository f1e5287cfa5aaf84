import numpy as np
import pytest
from free_throws import label_throws, write_throws

from besman.synthetic.free_throw import simulate_free_throw

RING_M = np.array([41.75, 0.0, 10.0]) * 0.3048


def test_the_ball_comes_down_through_the_ring():
    for trial in range(1, 6):
        throw = simulate_free_throw(trial)
        through = throw.landing(RING_M[2])
        assert np.linalg.norm(through - RING_M) < 0.6
        beyond = throw.landing()
        assert beyond[2] == pytest.approx(0.0, abs=1e-9)
        assert beyond[0] > through[0]


def test_the_same_trial_is_the_same_throw():
    one, same, other = (simulate_free_throw(trial) for trial in (1, 1, 2))
    assert repr(one.content) == repr(same.content)
    assert repr(one.content) != repr(other.content)


def test_the_ball_flies_freely_after_the_release():
    throw = simulate_free_throw(3, rate_hz=200.0)
    frames = throw.content["tracking"]
    ball = np.array([frame["data"]["ball"] for frame in frames]) * 0.3048
    time = np.arange(len(frames)) / 200.0
    seen = (time > throw.release_s) & np.isfinite(ball).all(axis=1)
    curve = np.polyfit(time[seen], ball[seen], 2)
    np.testing.assert_allclose(2 * curve[0], [0.0, 0.0, -9.81], atol=1.0)


def test_bones_keep_their_length(tmp_path):
    write_throws(tmp_path, 1)
    (recording,), _ = label_throws(tmp_path)
    forearm = np.linalg.norm(recording.marker("elbow") - recording.marker("wrist"), axis=1)
    assert np.ptp(forearm) < 0.06
    assert np.median(forearm) == pytest.approx(0.27, abs=0.01)
