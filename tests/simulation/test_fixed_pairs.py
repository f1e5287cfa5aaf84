"""The listed pairs of shapes against MuJoCo's own search for what can meet."""

import mujoco
import numpy as np
import pytest

from besman.pictures.scene_geoms import scene_geoms
from besman.robot.model import load_robot
from besman.simulation import scenes
from besman.simulation.scenes import lay_in_tool
from besman.simulation.tasks.ball_throw import ball_throw
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw import stick_throw

SCENES = [
    ("stick_throw", "ur5", "stick_holder", stick_throw, "stick_throw_model"),
    ("ball_throw", "compi", "scoop", ball_throw, "ball_model"),
]


@pytest.mark.parametrize(("task", "robot", "tool", "module", "build"), SCENES)
def test_contacts_are_those_that_mujoco_finds(task, robot, tool, module, build, monkeypatch):
    arm, task = load_robot(robot, tool), load_task(task)
    listed = getattr(module, build).__wrapped__(arm, task)
    monkeypatch.setattr(module, "fix_pairs", lambda spec, thing: None)
    found = getattr(module, build).__wrapped__(arm, task)
    assert found.npair == 0
    assert listed.npair > 0
    worlds = [(model, mujoco.MjData(model)) for model in (listed, found)]
    random, met = np.random.default_rng(0), set()
    tool_place = random.uniform(-0.05, 0.05, (300, 3))
    for place in tool_place:
        seen = []
        for model, data in worlds:
            data.qpos[: arm.n] = arm.home
            mujoco.mj_kinematics(model, data)
            site = data.site("tcp")
            data.qpos[arm.n : arm.n + 3] = site.xpos + site.xmat.reshape(3, 3) @ place
            mujoco.mju_mat2Quat(data.qpos[arm.n + 3 : arm.n + 7], site.xmat)
            mujoco.mj_forward(model, data)
            seen.append(
                sorted(
                    (round(one.dist, 12), *np.round(one.pos, 9), *one.friction, one.dim)
                    for one in data.contact
                )
            )
        met.add(len(seen[0]))
        np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    assert max(met) >= 2


def test_a_shape_far_above_changes_nothing(monkeypatch):
    arm, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
    with_it = stick_throw.stick_throw_model.__wrapped__(arm, task)
    monkeypatch.setattr(scenes, "_add_far_shape", lambda spec: None)
    without = stick_throw.stick_throw_model.__wrapped__(arm, task)
    assert with_it.ngeom == without.ngeom + 1
    assert scene_geoms(arm, with_it).ids == scene_geoms(arm, without).ids
    states = []
    for model in (with_it, without):
        data = mujoco.MjData(model)
        data.qpos[:] = lay_in_tool(model, arm.home[None], task.stick.length_m / 2)[0]
        data.ctrl[:] = arm.home + 0.2
        mujoco.mj_step(model, data, 200)
        states.append([*data.qpos, *data.qvel])
    assert states[0] == states[1]
