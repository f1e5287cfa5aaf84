from __future__ import annotations

import numpy as np
import pytest

from besman.exceptions import VerificationError
from besman.robot.model import load_robot
from besman.simulation.second_engine.drake_run import run_drake
from besman.simulation.second_engine.drake_scene import DrakeScene

pytest.importorskip("pydrake", reason="the extra verify is not installed")


@pytest.fixture(scope="module")
def scene():
    scene = DrakeScene(load_robot("ur5", "stick_holder"), 0.002, 0.1)
    scene.finish()
    return scene


def look_at(scene):
    def look(context):
        q = scene.plant.GetPositions(context, scene.arm)
        return q, scene.plant.GetVelocities(context, scene.arm), q[:1]

    return look


def test_it_goes_on_until_all_is_known(scene):
    home, seen = scene.robot.home, []

    def finished(run, span):
        seen.append((span.start, span.stop))
        return np.array([span.stop >= 100])

    controls = np.tile(home, (240, 1))
    run = run_drake(scene, home, controls, finished, look_at(scene))
    assert seen == [(0, 50), (50, 100)]
    assert run.steps.tolist() == [100]
    assert np.isfinite(run.qpos[0, :100]).all()
    assert np.isnan(run.qpos[0, 100:]).all()
    # The servos hold the arm: gravity bends each by its torque over the stiffness.
    assert np.abs(run.qpos[0, :100] - home).max() < 0.03


def test_what_drake_cannot_do_is_said(scene):
    controls = np.full((50, scene.robot.n), np.nan)
    with pytest.raises(VerificationError, match=r"^drake cannot go on: "):
        run_drake(scene, scene.robot.home, controls, lambda run, span: [False], look_at(scene))
