import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.synthetic.bells import Bell

BELLS = st.builds(
    Bell,
    start=st.floats(-2, 2),
    duration=st.floats(0.2, 2),
    peak=st.floats(0.3, 0.7),
    sharpness=st.floats(4, 6),
)


def test_the_symmetric_bell_is_minimum_jerk():
    share = np.linspace(0, 1, 50)
    np.testing.assert_allclose(
        Bell(1.0, 2.0).progress(1.0 + 2.0 * share),
        10 * share**3 - 15 * share**4 + 6 * share**5,
        atol=1e-12,
    )
    assert Bell(1.0, 2.0).peak_rate == pytest.approx(1.875 / 2)


@given(BELLS)
def test_speed_rises_and_falls_once(bell):
    time = np.linspace(bell.start - 0.1, bell.end + 0.1, 2001)
    progress = bell.progress(time)
    assert progress[0] == 0.0
    assert progress[-1] == 1.0
    speed = np.gradient(progress, time)
    fastest = int(np.argmax(speed))
    assert time[fastest] == pytest.approx(bell.peak_time, abs=3 * (time[1] - time[0]))
    assert speed[fastest] == pytest.approx(bell.peak_rate, rel=1e-3)
    assert np.all(np.diff(speed[: fastest - 1]) >= -1e-9)
    assert np.all(np.diff(speed[fastest + 1 :]) <= 1e-9)
