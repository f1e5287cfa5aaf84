import json

import numpy as np
import pytest
import yaml

from besman.exceptions import RecordingError
from besman.io import exports


@pytest.fixture
def trajectory():
    time = np.arange(50) / 1000
    rng = np.random.default_rng(0)
    return (time, *(rng.normal(size=(50, 6)) for _ in range(3)), tuple("abcdef"))


def test_csv_round_trip(tmp_path, trajectory):
    exports.write_joint_csv(tmp_path / "a.csv", *trajectory)
    for wrote, read in zip(trajectory, exports.read_joint_csv(tmp_path / "a.csv"), strict=False):
        np.testing.assert_allclose(read, wrote, rtol=1e-8)


@pytest.mark.parametrize("degrees", [360, 170, 85, 120, 1])
def test_a_movement_at_its_limit_is_not_beyond_it_by_rounding(tmp_path, degrees):
    limit = np.full((3, 1), np.radians(degrees))
    for sign in (1, -1):
        at = sign * limit
        exports.write_joint_csv(tmp_path / "a.csv", np.arange(3.0), at, at, at, ("a",))
        for read in exports.read_joint_csv(tmp_path / "a.csv")[1:]:
            assert np.all(np.abs(read) <= limit * (1 + 1e-10))


def test_csv_with_a_missing_column(tmp_path):
    (tmp_path / "a.csv").write_text("t,a\n0,1\n")
    with pytest.raises(RecordingError, match="three columns a joint, got 2"):
        exports.read_joint_csv(tmp_path / "a.csv")


def test_ros_message_rises_from_zero_and_keeps_the_samples(tmp_path, trajectory):
    time, *rest = trajectory
    message = exports.ros_joint_trajectory(time + 3.0, *rest)
    exports.write_ros_joint_trajectory(tmp_path / "a.json", message)
    read = json.loads((tmp_path / "a.json").read_text())
    stamps = [point["time_from_start"] for point in read["points"]]
    seconds = np.array([stamp["sec"] + 1e-9 * stamp["nanosec"] for stamp in stamps])
    assert seconds[0] == 0
    assert np.all(np.diff(seconds) > 0)
    np.testing.assert_allclose(seconds, time, atol=1e-9)
    np.testing.assert_array_equal([point["positions"] for point in read["points"]], rest[0])
    assert read["joint_names"] == list("abcdef")


@pytest.mark.parametrize("ending", ["json", "yaml"])
def test_ros_message_round_trip(tmp_path, trajectory, ending):
    path = tmp_path / f"a.{ending}"
    exports.write_ros_joint_trajectory(path, exports.ros_joint_trajectory(*trajectory))
    *columns, names = exports.read_ros_joint_trajectory(path)
    for wrote, read in zip(trajectory, columns, strict=False):
        np.testing.assert_allclose(read, wrote, atol=1e-9)
    assert names == trajectory[-1]


def test_the_yaml_is_yaml(tmp_path, trajectory):
    time, positions, *rest = trajectory
    message = exports.ros_joint_trajectory(time, positions * 1e-7, *rest)
    exports.write_ros_joint_trajectory(tmp_path / "a.yaml", message)
    read = yaml.safe_load((tmp_path / "a.yaml").read_text())
    assert read["header"] == message["header"]
    assert read["joint_names"] == message["joint_names"]
    for found, point in zip(read["points"], message["points"], strict=True):
        assert found["time_from_start"] == point["time_from_start"]
        assert found["effort"] == []
        np.testing.assert_allclose(found["positions"], point["positions"], atol=1e-9)
        np.testing.assert_allclose(found["accelerations"], point["accelerations"], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.pop("points"), "expected a JointTrajectory"),
        (lambda m: m["points"][1].update(velocities=[1.0]), "expected a JointTrajectory"),
        (lambda m: m["joint_names"].pop(), "expected 5 numbers a point"),
        (lambda m: m["points"].reverse(), "time_from_start to rise strictly"),
    ],
)
def test_a_message_that_cannot_be_used(tmp_path, trajectory, change, message):
    content = exports.ros_joint_trajectory(*trajectory)
    change(content)
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(RecordingError, match=message):
        exports.read_ros_joint_trajectory(tmp_path / "a.json")
