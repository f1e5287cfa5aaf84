"""Placements among boards: against brute force, and a task that stands in the arm's way."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import carry_box, map_box_task

from besman.motion.adapt_task import frame_matrix
from besman.robot.collision import place_all
from besman.robot.inverse_kinematics import solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.boxes import board_pose, box_poses
from besman.simulation.tasks.rearrange.shown_scene import list_scenes
from besman.stages.map import surroundings
from besman.stages.map.around_kernel import fill_lacks
from besman.stages.map.demonstration import tool_poses
from besman.stages.map.placement import PlacementSearch, find_placement
from besman.stages.map.placement_cost import ArmPaths, thin_rows
from besman.stages.map.stage import MapConfig
from besman.stages.map.surroundings import PlacedScene, thin_among
from besman.stages.map.terms import SAFE_DISTANCE_M
from besman.stages.map.whole_tasks import MapAmongBoards

TASK = load_whole_task("rearrange")


@functools.cache
def scene():
    """Robot, demonstration, its tool's poses, and what stands around it."""
    robot, demonstration, _ = map_box_task()
    tools = tool_poses(demonstration.hand, robot)
    (found,) = list_scenes([demonstration], [tools], TASK).values()
    return load_robot("ur5", "gripper3"), demonstration, tools, found


def test_boards_are_below_the_boxes_and_straight_ways_lead_to_them():
    _, demonstration, tools, found = scene()
    ((grasp_s, release_s),) = demonstration.holds_s
    assert found.n_boards == 2
    # A board's thickness and half a box below the middle, where boxes are at rest.
    down = TASK.box.size_m[2] / 2 + TASK.board.thickness_m / 2
    np.testing.assert_allclose(found.boxes[:2, 2, 3], found.boxes[2:, 2, 3] - down)
    # The gripper takes it where the hand did, in the median over one: there.
    row = int(np.argmin(np.abs(demonstration.hand.time - grasp_s)))
    np.testing.assert_allclose(found.ways[1, :3, 3], tools[row, :3, 3], atol=1e-9)
    assert found.ways[2, 2, 3] - found.ways[1, 2, 3] == pytest.approx(TASK.grasp.up_m)
    # At the box it does not stand in the gripper's way, before it does; boards always do.
    inside = (found.ways_s[:, None] >= found.since_s) & (found.ways_s[:, None] <= found.until_s)
    assert inside[:, :2].all()
    np.testing.assert_array_equal(inside[:, 2], [True, False, False, False, False, False])
    np.testing.assert_array_equal(inside[:, 3], [False, False, False, False, False, True])
    assert found.ways_s[0] < grasp_s < release_s < found.ways_s[-1]
    assert list_scenes([dataclasses.replace(demonstration, holds_s=np.empty((0, 2)), held=())],
                       [tools], TASK) == {}  # fmt: skip


def _points(ends):
    return np.linspace(ends[..., 0, :], ends[..., 1, :], 201)


def _outside(points, box, half):
    local = (points - box[:3, 3]) @ box[:3, :3]
    return np.linalg.norm(np.maximum(np.abs(local) - half, 0.0), axis=-1)


def test_gaps_and_costs_are_those_of_points_along_the_capsules():
    robot, demonstration, tools, found = scene()
    chain = robot.chain
    here = (chain.capsule_joints >= 0) & (chain.capsule_joints < robot.n - 1)
    rng = np.random.default_rng(1)
    rows = robot.home + rng.uniform(-0.8, 0.8, (20, robot.n))
    placement = np.eye(4)
    placement[:3, 3] = forward_kinematics(chain, robot.home[None])[0, :3, 3] - found.boxes[0, :3, 3]
    boards = placement @ found.boxes[:2]
    placed = place_all(
        chain.placements, chain.axes, chain.capsule_joints[here],
        np.array(chain.capsule_ends[here]), rows,
    )  # fmt: skip
    expected = np.min(
        [_outside(_points(placed), board, found.halves[0]).min(axis=0) for board in boards], axis=0
    )
    expected = (expected - chain.capsule_radii[here]).min(axis=1)
    gaps = PlacedScene(robot, boards, found.halves[:2]).gaps(rows)
    np.testing.assert_allclose(gaps, expected, atol=2e-3)
    # Single poses: what a path costs is what all of them fall short of the safe distance.
    around = thin_among([(demonstration.hand.time, tools)], [thin_rows(len(tools), 2)], [found])
    still = np.repeat(rows[:, None], around.paths.shape[1], axis=1)[None]
    none = np.zeros((*still.shape[:3], 2))
    bare = dataclasses.replace(
        around, present=np.tile([True, True, False, False], (1, still.shape[2], 1)),
        carries=np.zeros_like(around.carries),
    )  # fmt: skip
    lacks = np.maximum(0.0, 1.0 - gaps / SAFE_DISTANCE_M)
    np.testing.assert_allclose(
        bare.cost(robot, still, none, placement)[0], lacks * np.sqrt(still.shape[2]), atol=1e-9
    )
    missed = bare.cost(robot, still, none + 0.01, placement)[0]
    assert np.all(missed > lacks * np.sqrt(still.shape[2]))


def test_what_is_touched_between_two_poses_counts_for_the_second():
    robot, _, _, found = scene()
    chain = robot.chain
    here = (chain.capsule_joints >= 0) & (chain.capsule_joints < robot.n - 1)
    # Stretched out, and turned about its base.
    out = np.array([0.0, -0.5, 0.0, 0.0, 0.0, 0.0])
    turned = np.array([1.6, *out[1:]])
    rows = np.stack([out, turned])
    links = (chain.capsule_joints[here], chain.capsule_ends[here], chain.capsule_radii[here])
    # A small box where the forearm is halfway, which neither end is near.
    halfway = (out + turned) / 2
    ends = place_all(chain.placements, chain.axes, *map(np.array, links[:2]), halfway[None])
    box = np.eye(4)
    box[:3, 3] = ends[0, links[0] == 2].reshape(-1, 3).mean(axis=0)
    lacks = {}
    for name, present in (("there", True), ("gone before", False)):
        told = np.empty((1, 1, 2))
        fill_lacks(
            chain.placements, chain.axes, chain.tip, *map(np.array, links),
            np.array(found.carried), np.array(found.half), box[None, None],
            np.full((1, 1, 3), 0.01), np.array([[[present], [True]]]), np.zeros((1, 2), bool),
            SAFE_DISTANCE_M, rows[None, None], told,
        )  # fmt: skip
        lacks[name] = told[0, 0]
    assert lacks["there"][0] == 0.0
    assert lacks["there"][1] > 1.0
    np.testing.assert_array_equal(lacks["gone before"], 0.0)


def test_ends_of_straight_ways_stand_between_the_hands_poses_in_the_order_of_time():
    _, demonstration, tools, found = scene()
    rows = thin_rows(len(tools), 24)
    around = thin_among([(demonstration.hand.time, tools)], [rows], [found])
    assert around.paths.shape == (1, 30, 4, 4)
    np.testing.assert_array_equal(around.paths[0, around.own[0]], tools[rows])
    np.testing.assert_array_equal(around.paths[0, around.straight[0]], found.ways)
    assert np.all(np.diff(around.own[0]) >= 1)
    # Between the grasp and the release a box is carried: above where it stood, and above its place.
    carried = np.flatnonzero(around.carries[0])
    assert np.all(np.diff(carried) == 1)
    assert around.straight[0, carried].sum() == 2


def test_what_stands_where_the_arm_would_be_moves_the_placement():
    """A wall where the forearm is: with it another placement, or branch, is taken."""
    robot, demonstration, tools, found = scene()
    search = PlacementSearch(evaluations=40)
    arm = ArmPaths(robot, [(demonstration.hand.time, tools)], [found])
    usual = find_placement([arm], search)
    # In the middle of the forearm as the movement begins, in the frame of the demonstration.
    chain = robot.chain
    rows = solve_path(robot, usual.apply(tools[::30])).positions[:1]
    ends = place_all(chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends, rows)
    forearm = ends[0, chain.capsule_joints == 2].reshape(-1, 3).mean(axis=0)
    wall = np.eye(4)
    wall[:3, 3] = (np.linalg.inv(usual.pose) @ [*forearm, 1.0])[:3]
    walled = dataclasses.replace(
        found, boxes=np.concatenate([wall[None], found.boxes[1:]]),
        halves=np.concatenate([[[0.04, 0.04, 0.04]], found.halves[1:]]),
    )  # fmt: skip
    moved = find_placement([dataclasses.replace(arm, scenes=[walled])], search)
    cost = dataclasses.replace(arm, scenes=[walled]).cost(
        usual.centre, search.weights, search.ik, False, search.seed, None
    )
    middle = usual.pose[:3, :3] @ usual.centre + usual.pose[:3, 3]
    as_usual, _ = cost.terms(np.array([*middle, usual.yaw, 1.0]))
    assert as_usual[0, -1] > 1.0 > moved.terms["surroundings"]
    assert not np.allclose(moved.pose, usual.pose)
    assert "surroundings" not in find_placement([ArmPaths(robot, arm.paths)], search).terms


def test_without_a_grasp_it_is_the_mapping_as_it_was():
    robot, demonstration, _, _ = scene()
    config = MapConfig(evaluations=10, yaw=False)
    nothing = dataclasses.replace(demonstration, holds_s=np.empty((0, 2)), held=())
    among = MapAmongBoards(config).run((nothing,), robot, TASK)
    plain = config.run((demonstration.hand,), robot)
    np.testing.assert_array_equal(among.trajectories[0].positions, plain.trajectories[0].positions)


def test_scene_and_task_have_the_same_boards():
    """Boards that the mapping keeps clear of are those that are simulated."""
    robot, demonstration, plan = carry_box()
    tools = tool_poses(demonstration.hand, robot)
    (found,) = list_scenes([demonstration], [tools], TASK).values()
    frame = TASK.box_frame([plan], robot)
    simulated = [board_pose(pose, TASK) for pose in box_poses(plan.object_poses, frame)]
    # Told from the hand's own frame: the same up to where both stand, and the imitation's error.
    shown = frame_matrix(plan.object_poses[0])
    heading = 2 * np.arctan2(plan.object_poses[0, 6], plan.object_poses[0, 3])
    half = 0.5 * float(demonstration.object_headings[0, 0])
    before = frame_matrix(
        [*demonstration.object_positions[0, 0], np.cos(half), 0.0, 0.0, np.sin(half)]
    )
    ours = shown @ np.linalg.inv(before) @ found.boxes[0]
    assert np.isfinite(heading)
    np.testing.assert_allclose(ours, simulated[0], atol=0.01)
    assert surroundings.AROUND_WEIGHT > 0
