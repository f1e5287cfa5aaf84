"""How near a task comes to anything, beside what MuJoCo finds in the same postures (synthetic)."""

import dataclasses

import mujoco
import numpy as np
import pytest
from whole_task import carry_box

from besman.exceptions import OutOfReachError
from besman.motion.grasp_goals import lead_grasps
from besman.motion.grasp_postures import Postures, list_postures
from besman.motion.task_rollout import sample_task
from besman.robot.kinematics import forward_kinematics
from besman.simulation.tasks.grasp_box.gripper import gripper_capsules
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.clearance import Surroundings, list_holds
from besman.simulation.tasks.rearrange.rearrange_scene import rearrange_model

TASK = load_whole_task("rearrange")


def led_task(**grasp):
    robot, _, plan = carry_box()
    frame = TASK.box_frame([plan], robot)
    around = Surroundings.of(plan, robot, TASK, frame)
    way = TASK.grasp_way(frame, TASK.grasp.model_copy(update=grasp))
    return around, way, lead_grasps(plan, robot, way, Postures(plan, robot, around.gaps))


def test_boards_are_touched_where_mujoco_has_contacts():
    """In postures all around the boards: where there is a contact there is no gap."""
    around, _, led = led_task()
    n = around.robot.n
    model = rearrange_model(around.robot, TASK, around.before, around.after)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    rows = np.repeat(sample_task(led, 4.0)[1], 6, axis=0)
    rows += rng.normal(scale=0.25, size=rows.shape)
    boards = {k for k in range(model.ngeom) if "board" in model.geom(k).name}
    touched = []
    for row in rows:
        data.qpos[:] = [*row, 0, 0, 0, 0, 0, -9, 1, 0, 0, 0]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        touched.append(any(boards & {int(geom) for geom in c.geom} for c in data.contact))
    assert n == model.nq - 10
    assert sum(touched) > 10
    assert np.all(around.gaps(rows)[touched] < 1e-4)


def test_the_gripper_is_within_its_capsules():
    model = rearrange_model(carry_box()[0], TASK, *(np.eye(7)[[3]],) * 2)
    body = model.body("gripper").id
    (palm,) = np.flatnonzero(model.geom_bodyid == body)
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    corners = model.geom_pos[palm] + signs * model.geom_size[palm]
    ends, radii = gripper_capsules(TASK.gripper)
    way = ends[:, 1] - ends[:, 0]
    share = np.einsum("cij,cj->ci", corners[None] - ends[:, None, 0], way)
    share = np.clip(share / np.sum(way**2, axis=1)[:, None], 0, 1)
    off = corners[None] - ends[:, None, 0] - share[..., None] * way[:, None]
    assert np.all((np.linalg.norm(off, axis=2) - radii[:, None]).min(axis=0) < 1e-9)


def test_what_touches_is_told_before_it_is_simulated():
    around, _, led = led_task()
    assert around.clearance(led) > 0.002
    # A gripper that hardly leaves the box takes it along.
    touching = led_task(after_m=0.005)[2]
    assert around.clearance(touching) < 0.0
    (hold,) = list_holds(led)
    assert hold.close_s < hold.lifted_s < hold.lowering_s < hold.open_s
    assert hold.lifted_s - hold.close_s == pytest.approx(TASK.grasp.straight_s)


def test_what_is_carried_touches_a_board_below_the_gripper():
    around, _, led = led_task()
    (hold,) = list_holds(led)
    time, rows, _, _ = sample_task(led, 50.0)
    middle = rows[np.searchsorted(time, (hold.lifted_s + hold.lowering_s) / 2)]
    board = np.eye(4)
    board[:3, 3] = forward_kinematics(around.robot.chain, middle)[:3, 3] - [0.0, 0.0, 0.1]
    there = dataclasses.replace(around, boards=np.concatenate([around.boards, board[None]]))
    assert there.clearance(led) < 0.0


def test_other_postures_reach_the_same_and_touch_nothing():
    around, way, led = led_task()
    robot, _, plan = carry_box()
    goals = np.array(list_postures(plan, robot, way, around.gaps))
    assert len(goals) > 3
    taking = next(k for k, block in enumerate(plan.blocks) if block.frame == "object")
    tools = forward_kinematics(robot.chain, goals[:, taking])
    np.testing.assert_allclose(tools, np.broadcast_to(tools[0], tools.shape), atol=2e-3)
    assert np.all(around.gaps(goals[:, taking]) > 0.0)
    other = led_task(posture=1)[2]
    np.testing.assert_array_equal(other.blocks[taking].goal, goals[0, taking])
    away = [
        np.abs(one.goal - two.goal).max() for one, two in zip(led.blocks, other.blocks, strict=True)
    ]
    assert max(away) > 0.05
    with pytest.raises(OutOfReachError, match=r"no posture 500; there are \d+ others"):
        led_task(posture=500)
