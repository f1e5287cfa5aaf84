"""Arms that come from another package: each has a throw that it can run, and is what it says."""

import numpy as np
import pytest

from besman.report.run_records import load_records
from besman.robot.description_faults import check_robot
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.stages.map.stage import MapConfig

SHELF = ("ur3", "panda", "kinova_gen2", "z1", "xarm7", "so101")


@pytest.fixture(scope="module")
def throw(small_run):
    return load_records(small_run)["select"][:1]


@pytest.mark.parametrize("name", SHELF)
def test_an_arm_of_the_shelf_runs_a_throw(throw, name):
    robot = load_robot(name, "stick_holder")
    # Where five joints have to do, half of the movement at most, and it may be turned.
    scale = (0.2, 1.0) if robot.n > 5 else (0.2, 0.5)
    config = MapConfig(free_axis_spin=True, evaluations=24, scale=scale, yaw=robot.n == 5)
    mapping = config.run(throw, robot)
    (one,) = mapping.trajectories
    assert one.position_error.max() < 0.05
    assert one.time_stretch >= 0.99
    report = check_limits(robot, one.positions, one.velocities, one.accelerations)
    assert report.violations == report.self_collisions == 0


@pytest.mark.parametrize("name", SHELF)
def test_nothing_is_missing_of_it_and_it_stands_at_home(name):
    doubts = check_robot(name)
    assert not [one for one in doubts if one.kind == "missing"]
    assert not [one for one in doubts if "home" in one.text and one.kind == "doubtful"]
    wrong = ("published", "flange", "overlap in every")
    assert not [
        one for one in doubts if one.kind == "doubtful" and any(word in one.text for word in wrong)
    ]
    assert np.all(np.isfinite(load_robot(name).limits.torque))
