"""Slopes carried to an arm with its wrist turned over, against what the tool does there."""

from dataclasses import replace

import numpy as np
import pytest

from besman.motion.rollout import roll_out_plans
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.simulation.tasks.stick_throw.throw_and_flight import ballistic_touchdown
from besman.stages.refine.carried_slopes import carry_slopes, tool_slopes
from besman.stages.refine.plan_space import PlanSpace
from besman.stages.refine.postures import group_by_posture

PARTS = ("goal", "duration")
# A UR5's wrist turned over: the same poses of the tool.
TURN, SIGNS = np.array([0, 0, 0, np.pi, 0, -np.pi]), np.array([1.0, 1, 1, 1, -1, 1])


@pytest.fixture(scope="module")
def postures(robot, make_plan):
    plan = make_plan(3.0)
    turned = replace(
        plan,
        start=SIGNS * plan.start + TURN,
        goal=SIGNS * plan.goal + TURN,
        weights=SIGNS[:, None] * plan.weights,
    )
    return [PlanSpace(one, robot.limits, PARTS, 1) for one in (plan, turned)]


def landing(space, robot, point):
    """Return where what leaves the tool at 0.7 of a movement comes down, shape (2,)."""
    plan = space.plan_at(point)
    q, v, _ = (one[0] for one in roll_out_plans([plan], [0.7 * plan.duration]))
    twist = jacobian(robot.chain, q[0]) @ v[0]
    return ballistic_touchdown(forward_kinematics(robot.chain, q[0])[:3, 3], twist[:3])[:2]


def differences(space, robot, point):
    eye = 0.2 * np.eye(len(point))
    ends = [[landing(space, robot, point + s * one) for s in (1, -1)] for one in eye]
    return np.array([(a - b) / 0.4 for a, b in ends]).T


def test_what_is_carried_to_another_posture_is_what_would_be_measured_there(robot, postures):
    there, here = postures
    assert len(group_by_posture([there.plan_at(np.zeros(7)), here.plan_at(np.zeros(7))])) == 2
    known, wanted = (differences(one, robot, np.zeros(7)) for one in postures)
    slopes = [tool_slopes(one, np.zeros(7), robot, range(7)) for one in postures]
    found = carry_slopes(known[None], *slopes)[0]
    scale = np.linalg.norm(wanted)
    assert np.linalg.norm(known - wanted) > 0.3 * scale
    # What hardly moves the tool is carried for less than it is.
    assert np.linalg.norm(found - wanted) < 0.12 * scale
    # A step by it leads there as far as one by the slopes that are measured there.
    step = np.linalg.pinv(found) @ [0.02, -0.02]
    moved = landing(here, robot, step) - landing(here, robot, np.zeros(7))
    np.testing.assert_allclose(moved, [0.02, -0.02], atol=0.004)


def test_coordinates_that_were_not_measured_stay_out(robot, postures):
    slopes = [tool_slopes(one, np.zeros(7), robot, [0, 6]) for one in postures]
    assert not slopes[0][:, 1:6].any()
    found = carry_slopes(np.ones((2, 2, 7)), *slopes)
    assert not found[..., 1:6].any()
    assert found.shape == (2, 2, 7)
