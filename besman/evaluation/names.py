"""What can be compared, by name; nothing heavy is imported, so that help texts can name it."""

from __future__ import annotations

FUNCTION_NAMES = (
    "sphere",
    "rosenbrock",
    "contextual_sphere",
    "contextual_rosenbrock",
    "via_points",
    "via_points_joint",
    "obstacles",
    "obstacles_joint",
)
"""Functions that searches are compared on, see `besman.evaluation.refinement_functions`."""

TASK_RECIPES = {
    "stick_throw": "ur5_stick_throw",
    "ball_throw": "compi_ball_throw",
    "grasp_box": "iiwa7_grasp",
    "pull_lever": "ur10_lever",
}
"""Simulated tasks that they are compared on, and the pipeline whose imitations are refined."""

WHOLE_TASK_RECIPES = {"rearrange": "iiwa7_pick_and_place"}
"""Whole tasks, likewise."""

WHOLE_TASK_SEARCHES = ("block_by_block", "as_one", "from_scratch")
"""How these are refined, see `besman.evaluation.whole_task_problem.WholeTaskProblem`."""

HIERARCHY_NAMES = ("step", "object_rotation", "circle_drawing", "rotation")
"""Datasets of blocks and actions, see `besman.evaluation.hierarchy`."""
