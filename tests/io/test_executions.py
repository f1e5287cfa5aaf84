"""Logs of controllers: CSV and bags, and what is wrong with them."""

import numpy as np
import pytest
from ros_bags import EPOCH_NS, Messages, write_bag

from besman.exceptions import RecordingError
from besman.io.executions import read_execution

JOINTS = ("a", "b")
TIME = 0.01 * np.arange(40)
ANGLES = np.column_stack([np.sin(TIME), np.cos(TIME)])


def write(path, rows, columns="time_s,a,b"):
    path.write_text(f"# a controller's\n{columns}\n" + "\n".join(rows) + "\n")
    return path


def rows_of(time=TIME, angles=ANGLES):
    return [",".join(map(repr, map(float, row))) for row in np.column_stack([time, angles])]


def bag(path, stamps, names=JOINTS, angles=ANGLES):
    """Messages that are logged one after the other, whatever their own times say."""
    make = Messages()
    messages = [
        (EPOCH_NS + number, make.joints(EPOCH_NS + at, names, row))
        for number, (at, row) in enumerate(zip(map(int, stamps), angles, strict=True))
    ]
    return write_bag(path, {"/joint_states": messages})


STAMPS = (1e9 * TIME).round().astype(np.int64)


def test_csv_in_radians_and_degrees_with_other_columns(tmp_path):
    path = write(tmp_path / "a.csv", rows_of())
    found = read_execution(path, JOINTS)
    np.testing.assert_allclose(found.time, TIME)
    np.testing.assert_allclose(found.positions, ANGLES)
    assert found.is_aligned
    turned = np.column_stack([np.degrees(ANGLES[:, 1]), 0 * TIME, ANGLES[:, 0]])
    path = write(tmp_path / "b.csv", rows_of(angles=turned), "time_s,b_deg,current,a_rad")
    np.testing.assert_allclose(read_execution(path, JOINTS).positions, ANGLES)


def test_times_that_are_dates_count_from_the_first(tmp_path):
    """Of when the motion was sent off they say no more than those of a bag."""
    path = write(tmp_path / "a.csv", rows_of(1.7e9 + TIME))
    found = read_execution(path, JOINTS)
    np.testing.assert_allclose(found.time, TIME, atol=1e-6)
    assert not found.is_aligned


def test_a_bag_with_joints_in_another_order(tmp_path):
    path = bag(tmp_path / "a.mcap", STAMPS, ("b", "other", "a"), ANGLES[:, [1, 1, 0]])
    found = read_execution(path, JOINTS)
    np.testing.assert_allclose(found.positions, ANGLES, atol=1e-9)
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    assert not found.is_aligned


@pytest.mark.parametrize(
    ("rows", "columns", "message"),
    [
        (rows_of(), "time_s,a,c", "a log of another arm: no joint b; got a or c"),
        (rows_of(), "time_s,a,a_rad", "two columns for joint 'a'"),
        (rows_of()[:10] + rows_of()[20:], "time_s,a,b", r":13: time is 0\.2 s after 0\.09 s"),
        (rows_of()[:9] + rows_of()[:9], "time_s,a,b", r":12: time is 0 s after 0\.08 s"),
        (rows_of(angles=1e5 + ANGLES), "time_s,a,b", ":3: got 100001; expected joint angles of at"),
        ([*rows_of(), "0.4,1"], "time_s,a,b", ":43: got '0.4,1'; expected 3 numbers; is the file"),
    ],
)
def test_faults_of_a_table(tmp_path, rows, columns, message):
    with pytest.raises(RecordingError, match=message):
        read_execution(write(tmp_path / "a.csv", rows, columns), JOINTS)


def test_faults_of_a_bag(tmp_path):
    kept = np.r_[:10, 25:40]
    with pytest.raises(RecordingError, match=r"no joint states about 0\.1\d+ s after the first"):
        read_execution(bag(tmp_path / "gap.mcap", STAMPS[kept], angles=ANGLES[kept]), JOINTS)
    back = np.r_[STAMPS[:20], STAMPS[:20] + 5]
    with pytest.raises(RecordingError, match="'a': the time of message 21 is before that"):
        read_execution(bag(tmp_path / "back.mcap", back), JOINTS)
    with pytest.raises(RecordingError, match="another arm: no joint a, b; got x or y"):
        read_execution(bag(tmp_path / "other.mcap", STAMPS, ("x", "y")), JOINTS)
    far = ANGLES.copy()
    far[7, 0] = 1e6
    with pytest.raises(RecordingError, match=r"got 1e\+06; expected joint angles of at most 1000"):
        read_execution(bag(tmp_path / "far.mcap", STAMPS, angles=far), JOINTS)
    make = Messages()
    path = write_bag(tmp_path / "none.mcap", {"/say": [(EPOCH_NS, make.text("hello"))]})
    with pytest.raises(RecordingError, match="no topic of joint states; got /say"):
        read_execution(path, JOINTS)
    with pytest.raises(RecordingError, match="no such file"):
        read_execution(tmp_path / "nowhere.csv", JOINTS)
    with pytest.raises(RecordingError, match="cannot be read"):
        read_execution(tmp_path, JOINTS)
