import json
from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import PlanError, RunError
from besman.io.exports import read_joint_csv
from besman.motion import joint_move
from besman.motion.dmp import roll_out
from besman.records import RefinedMotion
from besman.robot.limits import LimitReport
from besman.robot.model import load_robot
from besman.stages.export import motion_exports
from besman.stages.export.motion_exports import write_exports
from besman.stages.export.withheld import withheld_because, withheld_motions


def refined(plan):
    time = np.arange(int(np.ceil(plan.duration * 1000)) + 1) / 1000
    movement = roll_out(plan.weights, plan.start, plan.goal, plan.duration, time)
    return RefinedMotion(
        plan, time, *movement, np.zeros(1), np.zeros(1), np.zeros(3), np.zeros(3),
        np.empty((0, 3)), np.zeros((len(time), 3)), True, 0.0, 0.0,
    )  # fmt: skip


def test_every_format_and_the_limits(tmp_path, robot, make_plan):
    motion = refined(make_plan(name="data/subject1:4"))
    write_exports((motion,), robot, tmp_path)
    endings = ("csv", "ros.json", "ros.yaml", "script")
    assert {path.name for path in tmp_path.iterdir()} == {
        "limits.json",
        *(f"subject1_4.{ending}" for ending in endings),
        *(f"subject1_4.approach.{ending}" for ending in endings[:3]),
    }
    report = json.loads((tmp_path / "limits.json").read_text())
    assert (report["robot"], report["tool"]) == ("ur5", "stick_holder")
    asked = report["motions"]["subject1_4"]
    assert asked["samples"] == len(motion.time)
    assert asked["success"] is True
    speed = np.abs(motion.velocities) / robot.limits.velocity
    assert asked["velocity_ratio"] == pytest.approx(speed.max(), abs=1e-6)
    assert asked["torque_ratio"] > 0
    assert asked["rests_at_ends"] is True
    assert asked["jerk_ratio"] == 0
    # A move from home to the first sample comes with it, gentle and free.
    time, q, v, a = read_joint_csv(tmp_path / "subject1_4.approach.csv")
    np.testing.assert_allclose(q[[0, -1]], [robot.home, motion.positions[0]], atol=1e-9)
    np.testing.assert_allclose([v[0], v[-1], a[0], a[-1]], 0, atol=1e-9)
    way = asked["approach"]
    assert way["duration_s"] == pytest.approx(time[-1])
    assert way["self_collisions"] == 0
    assert way["velocity_ratio"] <= 0.3
    assert "movej" in (tmp_path / "subject1_4.script").read_text()


def test_a_start_that_home_does_not_lead_to(tmp_path, robot, make_plan, monkeypatch):
    def blocked(*_):
        raise PlanError("straight it would touch itself")

    monkeypatch.setattr(joint_move, "move_straight", blocked)
    write_exports((refined(make_plan(name="a:1")),), robot, tmp_path)
    asked = json.loads((tmp_path / "limits.json").read_text())["motions"]["a_1"]
    assert asked["approach"] is None
    assert asked["no_approach"] == "from home: straight it would touch itself"
    assert not list(tmp_path.glob("*.approach.*"))
    assert (tmp_path / "a_1.script").read_text().count("movej") == 1


def test_a_motion_beyond_a_limit_is_not_given_to_an_arm(tmp_path, robot, make_plan):
    kept, fast = refined(make_plan(name="a:1")), refined(make_plan(name="a:2"))
    beyond = np.array(fast.accelerations)
    beyond[7:10, 2] = 1.001 * robot.limits.acceleration[2]
    write_exports((kept, replace(fast, accelerations=beyond)), robot, tmp_path)
    asked = json.loads((tmp_path / "limits.json").read_text())["motions"]
    assert asked["a_1"]["exported"] is True
    assert asked["a_2"]["exported"] is False
    assert asked["a_2"]["acceleration"] == 3
    assert list(tmp_path.glob("a_1.*"))
    assert not list(tmp_path.glob("a_2.*"))
    why = withheld_motions(tmp_path)["a_2"]
    assert why == f"beyond the limit of acceleration in 3 of {len(fast.time)} samples"


def test_what_touches_is_withheld_as_well():
    report = LimitReport(9, 0, 2, 0, 4, 0.0, 1.1, 0.0, -0.01)
    assert withheld_because(report) == (
        "beyond the limit of velocity in 2, "
        "touching itself, its pedestal or the floor in 4 of 9 samples"
    )


def test_no_urscript_for_other_arms(tmp_path):
    iiwa = load_robot("iiwa7", "none")
    rest = np.zeros((3, 7))
    plan = refined_at_rest(iiwa)
    write_exports((replace(plan, velocities=rest, accelerations=rest),), iiwa, tmp_path)
    assert not list(tmp_path.glob("*.script"))


def refined_at_rest(robot):
    from besman.records import MotionPlan

    home = np.array(robot.home)
    plan = MotionPlan(
        np.zeros((7, 10)), home, home, 0.002, robot.joint_names, 0.0,
        np.zeros(7), np.zeros(3), "a:1", "throw",
    )  # fmt: skip
    still = np.zeros((3, 7))
    return RefinedMotion(
        plan, np.arange(3) / 1000, np.tile(home, (3, 1)), still, still, np.zeros(1), np.zeros(1),
        np.zeros(3), np.zeros(3), np.empty((0, 3)), np.zeros((3, 3)), True, 0.0, 0.0,
    )  # fmt: skip


def test_a_file_that_does_not_hold_the_motion(tmp_path, robot, make_plan, monkeypatch):
    def broken(path, name, time, positions, way):
        real(path, name, time, positions + 1e-3, way)

    real = motion_exports.write_urscript
    monkeypatch.setattr(motion_exports, "write_urscript", broken)
    with pytest.raises(RunError, match=r"a_\.script: does not hold the motion|does not hold"):
        write_exports((refined(make_plan()),), robot, tmp_path)
