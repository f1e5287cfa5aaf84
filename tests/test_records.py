import numpy as np
import pytest

from besman.records import JointTrajectory, LabelledSegments, Recording, ShapeError


def test_arrays_are_copied_and_read_only():
    time = np.arange(3.0)
    recording = Recording(time, np.zeros((3, 1, 3)), ("a",), 1.0, "x")
    time[0] = 9
    assert recording.time[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        recording.positions[0] = 1


def test_lengths_must_agree():
    with pytest.raises(ShapeError, match=r"Recording\.positions must have shape \(3, M, 3\)"):
        Recording(np.arange(3.0), np.zeros((4, 1, 3)), ("a",), 1.0, "x")
    with pytest.raises(ShapeError, match="must name 1 trajectories, got 2"):
        Recording(np.arange(3.0), np.zeros((3, 1, 3)), ("a", "b"), 1.0, "x")
    with pytest.raises(ShapeError, match="must have 1 entries, got 0"):
        LabelledSegments([[0, 1]], (), [0.0], 1.0, "x")


def test_no_segments_is_a_record_too():
    segments = LabelledSegments(np.zeros((0, 2)), (), [], 1.0, "x")
    assert segments.bounds.shape == (0, 2)


def test_joint_trajectory_needs_as_many_velocities_as_positions():
    n = np.zeros((5, 6))
    with pytest.raises(ShapeError, match=r"velocities must have shape \(5, 6\)"):
        JointTrajectory(
            np.arange(5.0),
            n,
            n[:, :5],
            n,
            tuple("abcdef"),
            np.zeros((5, 7)),
            np.zeros(5),
            np.zeros(5),
            1.0,
            np.zeros(3),
            "a",
            "b",
        )
