import numpy as np
import pytest

from besman.exceptions import PlanError
from besman.records import (
    CartesianPlan,
    JointTrajectory,
    LabelledSegments,
    MotionPlan,
    Recording,
    ShapeError,
)


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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lead_out_s": 0.1}, "a: a joint_dmp rests at its ends; got a lead there"),
        ({"goal_velocity": [1.0, 0]}, "a: a joint_dmp rests at its ends; got a velocity there"),
        (
            {"kind": "joint_dmp_velocity", "goal_velocity": [1.0, 0]},
            "a: lead_out_s: got 0 s, expected more than 0 where the primitive moves at its end",
        ),
        (
            {"kind": "joint_dmp_velocity", "start_velocity": [1.0, 0], "lead_out_s": 0.1},
            "a: lead_in_s: got 0 s",
        ),
        (
            {"kind": "joint_dmp_velocity", "lead_in_s": 0.5, "lead_out_s": 0.5},
            "a: duration: got 0.9 s, expected more than the leads' 1 s",
        ),
    ],
)
def test_a_motion_plan_that_would_jump(change, message):
    with pytest.raises(PlanError, match=message):
        MotionPlan(
            np.ones((2, 5)), np.zeros(2), np.ones(2), 0.9, ("one", "two"), 0.1,
            np.zeros(7), np.zeros(3), "a", "throw", **change,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("duration", "message"),
    [
        (0.8, "a: start: got a quaternion of length 0, expected 1"),
        (0.0, "a: duration: got 0 s, expected more than 0"),
    ],
)
def test_a_cartesian_plan_with_a_quaternion_or_duration_of_zero(duration, message):
    with pytest.raises(PlanError, match=message):
        CartesianPlan(
            np.ones((6, 5)), np.zeros(7), np.zeros(7), duration, np.zeros(2), ("one", "two"), 0.1,
            True, 0.1, np.zeros(7), np.zeros(3), "a", "throw",
        )  # fmt: skip
