"""5. Imitate a throw, and refine it until it hits.

A motion plan is a dynamical movement primitive: some weights, a start, a goal and a duration. What
it makes of the stick is simulated; a black-box search changes the plan until the stick comes down
where the person's did.
"""

import numpy as np

from besman.config.resources import resource_folder
from besman.motion.adapt_plan import retarget_plan
from besman.motion.rollout import sample_plan
from besman.person.marker_set import load_marker_set
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.label.stage import LabelConfig
from besman.stages.map.stage import MapConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.refine.robustness import RobustnessConfig
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.select.stage import SelectConfig

# As in example 4.
folder = resource_folder("data") / "stick_throw"
inputs = read_inputs([str(folder / "subject1.tsv")])
labelled = LabelConfig().run(inputs.recordings, load_marker_set("right_arm"))
robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
demonstrations = SelectConfig(label="throw", object="stick").run(labelled, inputs.truth)[:2]
mapping = MapConfig(free_axis_spin=True, evaluations=40).run(demonstrations, robot)

# Imitate: least squares over a linear map, so it takes a millisecond.
plans = ImitateConfig(n_weights=20).run(mapping.trajectories, robot)
plan = plans[0]
error = np.degrees(plan.rmse)
print(f"{plan.name}: {plan.weights.size} weights, {plan.duration:.2f} s, {error:.2f} degrees off")

# A plan can be given another goal; it stays within all limits of the arm, or there is an error.
goal = plan.goal + np.radians([0, 0, 0, 0, 5, 0])
moved = retarget_plan(plan, robot, goal=goal)
time, q, v, a = sample_plan(moved, robot)
beyond = check_limits(robot, q, v, a).violations
print(f"another goal: {moved.duration:.2f} s, {beyond} of {len(time)} samples beyond a limit")

# Simulate the imitation as it is. The stick leaves its holder by contact alone.
(trial,) = try_plans(robot, task, [plan])
print(f"\nimitated: lands {100 * trial.miss:.1f} cm from the target")

# Refine: goal, duration and the smoothest changes of the weights are searched by CMA-ES.
stage = CmaEsConfig(episodes=200, robustness=None, seed=0)
for motion in stage.run(plans, robot, task):
    x, y = motion.outcome[:2]
    print(f"{motion.plan.name}: after {len(motion.returns)} episodes at x {x:.2f}, y {y:.2f} m,")
    print(f"  {100 * motion.miss:.1f} cm from the target: {'hit' if motion.success else 'missed'}")

# What would it do where the model is wrong? Five models with other friction, masses and servos.
(found,) = RobustnessConfig(models=5).run((motion,), robot, task)
misses = ", ".join(f"{100 * miss:.1f}" for miss in found.misses)
print(f"in five perturbed models: {found.success.sum()} hit, misses {misses} cm")
