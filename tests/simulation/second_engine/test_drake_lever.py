from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from besman.simulation.second_engine.drake_lever import pull_lever
from besman.simulation.tasks.kinds import load_task

pytest.importorskip("pydrake", reason="the extra verify is not installed")


def test_a_lever_ends_as_in_mujoco(puller, pull):
    task = load_task("pull_lever")
    plan = task.place(replace(pull, duration=1.0), puller)
    movements = task.move([plan], puller)
    first = task.simulate(puller, [plan], movements, False)
    second = pull_lever(puller, task, plan, movements)
    assert second.failures == first.failures == ("",)
    # The handle has 8 mm of room in the hook.
    np.testing.assert_allclose(second.outcomes, first.outcomes, atol=0.008)
    np.testing.assert_allclose(second.end_poses[0, :3], first.end_poses[0, :3], atol=0.004)
