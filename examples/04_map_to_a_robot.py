"""4. Map to a robot, and read the price.

A person's hand movement does not fit a robot as it is. One placement is chosen for all
demonstrations, the joints are solved for, and what is too fast is slowed down, but only where a
change of the path by a few millimetres does not help.
"""

import numpy as np

from besman.config.resources import resource_folder
from besman.person.marker_set import load_marker_set
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import load_robot
from besman.stages.label.stage import LabelConfig
from besman.stages.map.stage import MapConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.select.stage import SelectConfig

folder = resource_folder("data") / "stick_throw"
inputs = read_inputs([str(folder / "subject1.tsv")])
labelled = LabelConfig().run(inputs.recordings, load_marker_set("right_arm"))

# Demonstrations: here the manual segments of class `throw`; in a pipeline the recognized ones.
# The hand's poses are in the person's own frame. Where the stick came down is the target.
select = SelectConfig(label="throw", object="stick", least_duration_s=0.2)
demonstrations = select.run(labelled, inputs.truth)[:4]
first = demonstrations[0]
reach = np.ptp(first.poses[:, :3], axis=0)
print(f"{len(demonstrations)} demonstrations; the first lasts {first.time[-1]:.2f} s")
print(
    f"its hand moves {reach[0]:.2f} m ahead, {reach[1]:.2f} m across, {reach[2]:.2f} m up or down"
)

# A stick may turn about its own axis: that rotation is free. Fewer placements are tried than usual.
# Ahead of the robot is ahead of the person; with yaw, turned placements are tried as well.
within = MapConfig(free_axis_spin=True, evaluations=20, yaw=False)
exact = within.model_copy(update={"greatest_change_m": 0.0, "greatest_change_deg": 0.0})
for name, stage, what in (
    ("ur5", within, "the path may change by 5 mm and 5 degrees"),
    ("compi", within, "the path may change by 5 mm and 5 degrees"),
    ("compi", exact, "the path is kept, time alone is stretched"),
):
    robot = load_robot(name, "stick_holder")
    mapping = stage.run(demonstrations, robot)
    print(f"\n{name}: {len(mapping.trajectories)} of {len(demonstrations)} transferred; {what}")
    x, y, z = mapping.placement[:3, 3]
    print(f"  the person's back is at x {x:.2f}, y {y:.2f}, z {z:.2f} m of the robot's world")

    # The price: how far the tool leaves the demonstrated path, and how much slower it is.
    error = np.concatenate([one.position_error for one in mapping.trajectories])
    slower = [one.time_stretch for one in mapping.trajectories]
    print(f"  position error: mean {1000 * error.mean():.1f} mm, most {1000 * error.max():.1f} mm")
    print(f"  duration over the person's: median {np.median(slower):.2f}, most {max(slower):.2f}")

    # Checked at 1 kHz: nothing is beyond a limit.
    one = mapping.trajectories[0]
    time, q, v, a = resample_trajectory(one.time, one.positions, one.velocities, one.accelerations)
    report = check_limits(robot, q, v, a)
    print(f"  the first at 1 kHz: {report.samples} samples, {report.violations} beyond a limit;")
    print(f"  {report.velocity_ratio:.0%} of the speed and {report.torque_ratio:.0%} of the torque")
    print(f"  limits, {100 * report.least_distance:.1f} cm from itself, pedestal and floor")
