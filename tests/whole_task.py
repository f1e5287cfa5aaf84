"""A synthetic person's way with a box, on a UR5: mapped once for the tests that look at it."""

import functools

import numpy as np

from besman.evaluation.recognition_data import name_parts
from besman.person.marker_set import load_marker_set
from besman.planning.learnt import learn_tasks
from besman.records.layers import building_blocks
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.imitate.task_plans import plan_task
from besman.stages.map.stage import MapConfig
from besman.stages.map.whole_tasks import MapTasks
from besman.stages.select.block_steps import DivideActions, FindActions
from besman.stages.select.stage import SelectConfig
from besman.synthetic.datasets import captures

GRAMMAR = {
    "to_table": ("approach_forward", "move_obj_table", "move_to_rest_right"),
    "to_shelf": ("approach_right", "move_obj_shelf", "move_to_rest_down"),
}
MARKERS = load_marker_set("right_arm")


def make_select(action="to_table", actions=GRAMMAR, **more):
    return SelectConfig(**{"action": action, "actions": actions, "as": "blocks", **more})


@functools.cache
def record_take():
    """Recording and true blocks of one person."""
    (capture,) = captures("pick_and_place", 1, 1, seed=0)
    return name_parts(capture.recording), building_blocks(capture.segments)


def divide_actions(recording, blocks, config):
    """Return the demonstrations of an action with their blocks."""
    actions = FindActions(config).run((recording,), (blocks,), ())
    hands = config.run((recording,), actions)
    return DivideActions(config).run((recording,), (blocks,), actions, hands, MARKERS)


def block_goals(plan):
    """Return the joint angles (B, n) at the end of each block, rad."""
    return np.stack([block.goal for block in plan.blocks])


@functools.cache
def map_box_task():
    """Return robot, demonstration, and mapped task."""
    robot = load_robot("ur5", "gripper")
    (demonstration,) = divide_actions(*record_take(), make_select())
    config = MapConfig(evaluations=40, yaw=True)
    mapping = config.run((demonstration.hand,), robot)
    (task,) = MapTasks(config).run(mapping, (demonstration,), robot)
    return robot, demonstration, task


@functools.cache
def carry_box():
    """Return robot with gripper, demonstration, and the task as imitated, of another person."""
    (capture,) = captures("pick_and_place", 1, 1, seed=1)
    take = name_parts(capture.recording), building_blocks(capture.segments)
    (demonstration,) = divide_actions(*take, make_select())
    robot = load_robot("ur5", "gripper3")
    config = MapConfig(evaluations=40, yaw=False, weights={"position": 5, "singularity": 5})
    mapping = config.run((demonstration.hand,), robot)
    (task,) = MapTasks(config).run(mapping, (demonstration,), robot)
    return robot, demonstration, plan_task(task, robot, 20, leads_s=(0.1, 0.2))


@functools.cache
def learn_both():
    """What an iiwa 7 learns of one person who puts a box on a table and back."""
    (capture,) = captures("pick_and_place", 1, 1, seed=1)
    take = name_parts(capture.recording), building_blocks(capture.segments)
    found = divide_actions(*take, make_select(("to_table", "to_shelf")))
    robot = load_robot("iiwa7", "gripper3")
    config = MapConfig(evaluations=40, weights={"position": 5, "singularity": 5})
    mapping = config.run(tuple(one.hand for one in found), robot)
    plans = tuple(plan_task(one, robot, 20) for one in MapTasks(config).run(mapping, found, robot))
    return learn_tasks(plans, set(), robot, load_whole_task("rearrange"))
