"""What a process has that a throw was rehearsed in."""

import pickle

from besman.robot.collision import _distances
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw.stick_throw import stick_throw_model
from besman.stages.refine import rehearsal


def test_what_a_throw_takes_is_there_for_an_arm_that_is_sent():
    robot = rehearsal.rehearse()
    assert _distances.signatures
    assert pickle.loads(pickle.dumps(robot)) is robot
    before = stick_throw_model.cache_info()
    stick_throw_model(robot, load_task("stick_throw"))
    assert stick_throw_model.cache_info().hits == before.hits + 1
