"""6. Your own robot, your own task, and a template for targets that were never tried.

The robot is made from a URDF, the task from a few lines of YAML. A template then answers in
milliseconds what it takes to throw somewhere else.
"""

from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory

import yaml

from besman.config.resources import resource_folder
from besman.person.marker_set import load_marker_set
from besman.robot.description_faults import check_robot
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot
from besman.simulation.tasks.kinds import load_task
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.label.stage import LabelTrajectoriesConfig
from besman.stages.map.stage import MapConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.select.stage import SelectConfig
from besman.templates.applying import apply_template
from besman.templates.learning import TemplateConfig
from besman.templates.teaching import prepare_lesson, teach
from besman.work.work import Work

folder = TemporaryDirectory()  # is removed at the end
place = Path(folder.name)

# The robot. What the URDF does not say is assumed, and listed, for you to look at.
urdf = place / "arm.urdf"
copy(resource_folder("robots") / "compi" / "compi.urdf", urdf)
path = add_robot(urdf, tip="flange", name="my_arm")
for doubt in check_robot(str(path)):
    print(f"{doubt.kind:9} {doubt.text}")

# Put it right: a pedestal, a home from which the arm can move, and a scoop to throw with.
content = yaml.safe_load(path.read_text())
for joint, home_deg in zip(content["joints"], (0, 40, -80, 0, -50, 0), strict=True):
    joint["home_deg"] = home_deg
content["mounting"] |= {"height_m": 0.75, "yaw_deg": 180, "pedestal_radius_m": 0.1}
content["tools"] = {
    "scoop": {
        "translation_m": [0, 0, 0.15],  # from the tip link to the centre of the ball
        "rotation_wxyz": [0.707107, 0, -0.707107, 0],
        "hand_to_tcp_wxyz": [0, 1, 0, 0],  # how the tool follows the person's hand
        "hand_to_tcp_m": [0.05, 0, -0.04],
        "mass_kg": 0.15,
    }
}
path.write_text(yaml.safe_dump(content))
robot = load_robot(path, "scoop")
print(f"{robot.name}: {robot.n} joints, base {robot.base_height:.2f} m above the floor")

# The task: a golf ball, to the left. What is not said keeps its default.
golf = place / "golf.yaml"
golf.write_text(
    "kind: ball_throw\ntarget_m: [1.5, 0.4]\nball: {radius_m: 0.0214, mass_kg: 0.0459}\n"
)
task = load_task(str(golf))

# The person throws a ball; the markers have no names.
inputs = read_inputs(
    [str(resource_folder("data") / "ball_throw")],
    str(resource_folder("data") / "stick_throw_calibration" / "person.tsv"),
)
label = LabelTrajectoriesConfig(learn_from="person.tsv", longest_rigid_gap_s=3.0)
labelled = label.run(inputs.recordings, load_marker_set("right_arm"), inputs.teacher)
demonstrations = SelectConfig(label="throw").run(labelled, inputs.truth)[:1]

# As in examples 4 and 5, on the own arm. A throw may also begin elsewhere.
mapping = MapConfig(yaw=False, evaluations=20).run(demonstrations, robot)
plans = ImitateConfig().run(mapping.trajectories, robot)
refine = CmaEsConfig(episodes=400, search=("start", "goal", "duration"), sigma=0.8, robustness=None)
motions = refine.run(plans, robot, task)
motion = motions[0]
print(f"\nimitated: {100 * motion.miss_before:.0f} cm from the target")
print(f"refined: {100 * motion.miss:.1f} cm, after {len(motion.returns)} episodes")

# A template: which motion belongs to which target within 20 cm? Usually it takes 3000 episodes.
config = TemplateConfig(method="c_cma_es", episodes=500, checks=20, search=("goal", "duration"))
region = {"x": (1.3, 1.7), "y": (0.2, 0.6)}
lesson = prepare_lesson(motions, robot, task, ("x", "y"), region, config)
template = teach(lesson, config, (str(path), "scoop", str(golf)), Work(2))
for x, y in ((1.4, 0.3), (1.6, 0.5), (1.8, 0.4)):
    answer = apply_template(template, robot, task, [x, y])
    (miss,) = lesson.try_points(template.policy.means([[x, y]]), [[x, y]]).misses
    lands, expected = 100 * miss, 100 * answer.forecast.miss
    print(f"target {x}, {y}: lasts {answer.time[-1]:.2f} s")
    print(f"  misses by {lands:.1f} cm, forecast {expected:.1f} cm")
    for warning in answer.warnings:
        print(f"  {warning}")
