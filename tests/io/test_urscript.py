import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.urscript import CYCLE_S, read_urscript, write_urscript


def movement(count):
    time = np.arange(count) / 1000
    return time, np.sin(time[:, None] * np.arange(1, 7))


@pytest.mark.parametrize("count", [9, 17, 20, 1001])
def test_round_trip(tmp_path, count):
    time, positions = movement(count)
    path = tmp_path / "a.script"
    write_urscript(path, "subject1_2", time, positions)
    cycles, points = read_urscript(path)
    np.testing.assert_allclose(np.diff(cycles), CYCLE_S)
    rows = np.minimum(np.arange(len(points)) * 8, count - 1)
    np.testing.assert_allclose(points, positions[rows], atol=1e-10)
    np.testing.assert_allclose(points[-1], positions[-1], atol=1e-10)
    assert 0 <= cycles[-1] - time[-1] < CYCLE_S


def test_the_program(tmp_path):
    write_urscript(tmp_path / "a.script", "sub-ject 1", *movement(17))
    lines = (tmp_path / "a.script").read_text().splitlines()
    assert lines[0] == "def besman_sub_ject_1():"
    assert lines[-1] == "end"
    assert sum(line.startswith("  movej([") for line in lines) == 1
    # t in the range of the manual, lookahead in [0.03, 0.2], gain in [100, 2000].
    assert all("0, 0, 0.008, lookahead_time, gain)" in line for line in lines if "servoj" in line)
    assert "  lookahead_time = 0.03" in lines
    assert "  gain = 500" in lines


def test_what_does_not_fit(tmp_path):
    time, positions = movement(20)
    for bad in ((time * 1.1, positions), (time**2, positions), (time, positions[:, :5])):
        with pytest.raises(RecordingError, match="six joints and samples evenly spaced"):
            write_urscript(tmp_path / "a.script", "a", *bad)
    (tmp_path / "b.script").write_text("def a():\nend\n")
    with pytest.raises(RecordingError, match="expected movej"):
        read_urscript(tmp_path / "b.script")


def test_a_joint_at_its_limit_is_not_beyond_it(tmp_path):
    """Within what the check of limits lets pass as rounding."""
    time, limit = np.arange(17) / 1000, np.radians([360, 180, 150, 95, 3, 170])
    write_urscript(tmp_path / "a.script", "a", time, np.tile(limit, (17, 1)))
    _, points = read_urscript(tmp_path / "a.script")
    assert np.max(points - limit) < 1e-9


def test_the_way_to_the_start(tmp_path):
    time, positions = movement(17)
    way = np.stack([positions[0] - 1.0, positions[0] - 0.5, positions[0]])
    write_urscript(tmp_path / "a.script", "a", time, positions, way)
    lines = (tmp_path / "a.script").read_text().splitlines()
    assert sum(line.startswith("  movej([") for line in lines) == 3
    assert sum("not checked for collisions" in line for line in lines) == 1
    _, points = read_urscript(tmp_path / "a.script")
    np.testing.assert_allclose(points[0], positions[0], atol=1e-10)
