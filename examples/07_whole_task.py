"""7. A whole task: a person puts a box on a table, a robot does it block by block, and another.

The recordings are synthetic. An action is a sequence of blocks; the gripper is brought to the box
in the first way that touches nothing; what was learnt does what nobody has shown.
"""

from besman.evaluation.recognition_data import name_parts
from besman.person.marker_set import load_marker_set
from besman.planning.goals import parse_goals
from besman.planning.learnt import learn_tasks
from besman.planning.planned_run import plan_goals
from besman.records.layers import building_blocks
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.imitate.task_plans import ImitateTasks
from besman.stages.map.stage import MapConfig
from besman.stages.map.whole_tasks import MapTasks
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.refine.whole_tasks import AimTasks, SimulateTasks
from besman.stages.select.block_steps import DivideActions, FindActions
from besman.stages.select.stage import SelectConfig
from besman.synthetic.datasets import captures

# One recording, its markers named, and its segments as a person would name them.
(capture,) = captures("pick_and_place", 1, 1, seed=1)
recording = (name_parts(capture.recording),)
segments = (building_blocks(capture.segments),)

# Two actions, by the blocks that they consist of.
config = SelectConfig(
    **{"as": "blocks"},
    action=("to_table", "to_shelf"),
    actions={
        "to_table": ("approach_forward", "move_obj_table", "move_to_rest_right"),
        "to_shelf": ("approach_right", "move_obj_shelf", "move_to_rest_down"),
    },
)
actions = FindActions(config).run(recording, segments, ())
hands = config.run(recording, actions)
markers = load_marker_set("right_arm")
shown = DivideActions(config).run(recording, segments, actions, hands, markers)
for one in shown:
    (grasp, release), *_ = one.holds_s
    print(f"{one.hand.label}: {', '.join(one.labels)}; box held {grasp:.2f} to {release:.2f} s")

# Mapped as one way, imitated block by block, simulated.
robot, task = load_robot("iiwa7", "gripper3"), load_whole_task("rearrange")
mapping_config = MapConfig(evaluations=40, weights={"position": 5, "singularity": 5})
mapping = mapping_config.run(tuple(one.hand for one in shown), robot)
mapped = MapTasks(mapping_config).run(mapping, shown, robot)
plans = ImitateTasks(ImitateConfig()).run(mapped, robot)
aimed = AimTasks(CmaEsConfig()).run(plans, robot, task)
for trial in SimulateTasks(CmaEsConfig()).run(aimed, plans, robot, task):
    came = trial.failure or f"box {1000 * trial.miss:.1f} mm beside its place"
    print(f"{trial.name}, {trial.duration:.1f} s: {came}")

# The same blocks, for a place at which nobody has put the box.
learnt = learn_tasks(plans, set(), robot, task)
at = learnt.places[1].pose
goal = f"box1 on {learnt.places[1].name} at x={at[0] + 0.05:.2f},y={at[1] - 0.05:.2f}"
made = plan_goals("plan", parse_goals(goal), (), learnt)
print(f"{goal}: {', '.join(block.label for block in made.blocks)}")
print(f"{'succeeds' if made.success else made.trial.failure}, {1000 * made.trial.miss:.1f} mm off")
