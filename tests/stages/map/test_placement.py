import numpy as np
import pytest

from besman.config.stage import Work
from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError
from besman.records import HandTrajectory
from besman.robot.model import load_robot
from besman.stages.map.demonstration import tool_poses
from besman.stages.map.placement import PlacementSearch, correct_placement, find_placement
from besman.stages.map.placement_cost import ArmPaths, scale_about
from besman.stages.map.stage import MapConfig, map_results

ROBOT = load_robot("ur5", "gripper")
LOOKING_DOWN = np.array([0.5, -0.5, 0.5, 0.5])


def reach(index, offset=(0.0, 0.0, 0.0), size=1.0):
    """A straight reach of 0.3 m forward in a second."""
    time = np.linspace(0, 1, 51)
    u = 10 * time**3 - 15 * time**4 + 6 * time**5
    start = np.array([0.3, -0.2, 0.1]) + np.random.default_rng(index).normal(0, 0.01, 3) + offset
    path = start + size * np.outer(u, [0.3, 0.05, 0.05])
    poses = np.hstack([path, np.tile(LOOKING_DOWN, (51, 1))])
    return HandTrajectory(time, poses, f"a.tsv:{index}", "reach")


def arm(*demonstrations, robot=ROBOT):
    return ArmPaths(robot, [(one.time, tool_poses(one, robot)) for one in demonstrations])


def test_both_optimizers_serve_the_same_demonstrations():
    for optimizer in ("cma_es", "differential_evolution"):
        config = MapConfig(evaluations=80, optimizer=optimizer, yaw=False)
        results = map_results(config.run((reach(0), reach(1)), ROBOT, Work()))
        assert results["n_transferred"] == 2, optimizer
        assert results["position_error_m"]["max"] < 0.005
        assert results["limit_violations"] == results["self_collisions"] == 0


def test_what_is_not_free_stays():
    search = PlacementSearch(evaluations=30, yaw=False)
    placement = find_placement([arm(reach(0))], search)
    np.testing.assert_array_equal(placement.pose[:3, :3], np.eye(3))
    assert placement.scale == 1.0


def test_a_movement_too_large_for_the_arm_is_made_smaller():
    huge = reach(0, size=6.0)
    search = PlacementSearch(evaluations=80, scale=(0.3, 1.0), yaw=False)
    placement = find_placement([arm(huge)], search)
    assert 0.3 <= placement.scale < 0.95
    assert (
        placement.terms["position"]
        < find_placement([arm(huge)], PlacementSearch(evaluations=80, yaw=False)).terms["position"]
    )
    placed = placement.apply(tool_poses(huge, ROBOT))
    length = np.linalg.norm(np.diff(placed[:, :3, 3], axis=0), axis=1).sum()
    before = np.linalg.norm(np.diff(huge.poses[:, :3], axis=0), axis=1).sum()
    assert length == pytest.approx(placement.scale * before)


def test_scaling_keeps_the_centre_and_the_orientations():
    poses = tool_poses(reach(0), ROBOT)
    centre = poses[10, :3, 3]
    scaled = scale_about(poses, centre, 0.5)
    np.testing.assert_allclose(scaled[10], poses[10])
    np.testing.assert_array_equal(scaled[:, :3, :3], poses[:, :3, :3])
    np.testing.assert_allclose(
        scaled[-1, :3, 3] - centre, 0.5 * (poses[-1, :3, 3] - centre), atol=1e-12
    )


def test_a_demonstration_that_is_served_is_not_moved():
    search = PlacementSearch(evaluations=60, yaw=False)
    common = find_placement([arm(reach(0), reach(1))], search)
    own = correct_placement(arm(reach(0)), search, common)
    middle = np.append(reach(0).poses[:, :3].mean(axis=0), 1.0)
    assert np.linalg.norm((own.pose - common.pose) @ middle) < 0.05


def test_a_demonstration_far_from_the_others_gets_a_placement_of_its_own():
    far = reach(7, offset=(3.0, 0.0, 0.0))
    others = tuple(reach(index) for index in range(4))
    config = MapConfig(evaluations=80, yaw=False)
    left = config.model_copy(update={"correct": False}).run((*others, far), ROBOT)
    assert [one.name for one in left.failed] == ["a.tsv:7"]
    mapping = config.run((*others, far), ROBOT)
    assert mapping.failed == ()
    (correction,) = mapping.corrected
    assert correction.name == "a.tsv:7"
    assert correction.reason.startswith("position error ")
    assert 1.0 < correction.shift_m < 4.0
    assert map_results(mapping)["corrected"][0]["shift_m"] == correction.shift_m
    # The others are where they were.
    kept = {one.name: one for one in left.trajectories}
    for one in mapping.trajectories:
        if one.name != far.name:
            assert one.positions.tobytes() == kept[one.name].positions.tobytes()


def test_many_demonstrations_are_placed_by_some_of_them():
    config = MapConfig(evaluations=30, placement_demonstrations=2, yaw=False)
    few = config.run((reach(0), reach(2)), ROBOT)
    many = config.run((reach(0), reach(1), reach(2)), ROBOT)
    np.testing.assert_array_equal(few.placement, many.placement)


def test_two_arms_share_one_placement():
    arms = [load_robot(name) for name in ("rh5_right", "rh5_left")]
    paths = [
        arm(reach(0), robot=arms[0]),
        arm(reach(1, offset=(0.0, 0.5, 0.0)), robot=arms[1]),
    ]
    search = PlacementSearch(evaluations=60)
    placement = find_placement(paths, search)
    cost = [find_placement([one], search).cost for one in paths]
    assert placement.cost >= np.mean(cost) - 0.05
    assert placement.terms["position"] < 1.0


def test_a_scale_must_be_a_range():
    with pytest.raises(ConfigError, match=r"got \[1.0, 0.5\], expected the least factor before"):
        parse_config({"scale": [1.0, 0.5]}, MapConfig, "p.yaml")
