import numpy as np
import pytest

from besman.imitation.dmp import roll_out
from besman.imitation.stage import ImitateConfig, imitate_results
from besman.records import JointTrajectory
from besman.stage import Work


def trajectory(name="a", moving_end=0.3):
    time = np.linspace(0, 0.6, 61)
    x = time / 0.6
    blend = 10 * x**3 - 15 * x**4 + 6 * x**5
    rate = (30 * x**2 - 60 * x**3 + 30 * x**4) / 0.6
    positions = np.column_stack([blend + moving_end * x, -blend])
    velocities = np.column_stack([rate + moving_end / 0.6, -rate])
    return JointTrajectory(
        time=time,
        positions=positions,
        velocities=velocities,
        accelerations=np.zeros((61, 2)),
        joint_names=("one", "two"),
        poses=np.tile([0.5, 0, 1, 1, 0, 0, 0], (61, 1)),
        position_error=np.zeros(61),
        orientation_error=np.zeros(61),
        time_stretch=1.0,
        target=np.array([2.0, 0, 0]),
        name=name,
        label="throw",
    )


def test_plan_follows_the_demonstration_between_its_leads():
    demonstration = trajectory()
    (plan,) = ImitateConfig().run((demonstration,))
    assert plan.duration == pytest.approx(0.9)
    assert (plan.name, plan.label, plan.joint_names) == ("a", "throw", ("one", "two"))
    np.testing.assert_array_equal(plan.target, demonstration.target)
    np.testing.assert_array_equal(plan.goal_pose, demonstration.poses[-1])
    q, v, _ = roll_out(plan.weights, plan.start, plan.goal, plan.duration, demonstration.time + 0.1)
    assert np.sqrt(np.mean((q - demonstration.positions) ** 2)) == pytest.approx(plan.rmse)
    assert plan.rmse < 1e-3
    np.testing.assert_allclose(v, demonstration.velocities, atol=0.1)


def test_without_leads_the_plan_has_the_demonstrations_ends():
    demonstration = trajectory(moving_end=0.0)
    (plan,) = ImitateConfig(lead_in_s=0, lead_out_s=0).run((demonstration,))
    np.testing.assert_array_equal(plan.start, demonstration.positions[0])
    np.testing.assert_array_equal(plan.goal, demonstration.positions[-1])
    assert plan.duration == pytest.approx(0.6)
    assert plan.rmse < 1e-3


def test_results_and_progress():
    done = []
    plans = ImitateConfig().run(
        (trajectory("a"), trajectory("b", 0.5)), work=Work(progress=done.append)
    )
    assert done == [0.5, 1.0]
    errors = [plan.rmse for plan in plans]
    assert imitate_results(plans) == {
        "rmse_rad": {"mean": pytest.approx(np.mean(errors)), "max": max(errors)}
    }
