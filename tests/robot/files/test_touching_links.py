"""Ignored pairs: nothing that meshes say touches is called clear."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from scipy.spatial import ConvexHull

from besman.config.yaml_file import load_config
from besman.robot.config import RobotConfig
from besman.robot.files.touching_links import (
    always_overlapping,
    capsules_that_say_nothing,
    find_ignored_pairs,
    mesh_contacts,
    pair_overlaps,
    random_poses,
)
from besman.robot.link_shapes import collision_shapes
from besman.robot.model import load_robot, read_robot_urdf
from besman.robot.new_robot import add_robot

LINK = """<link name="l{0}"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="l{0}.obj"/></geometry></collision></link>"""
JOINT = """<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/>
<origin xyz="{3} 0 {2}"/><axis xyz="{4}"/><limit lower="-2.6" upper="2.6" effort="90" velocity="2"/>
</joint>"""
# Low, height and half-width of each link's box, offset and height of the joint behind it. The
# second link is a disc that is flat: the capsule around it reaches into the links beside it.
BOXES = [(0, 0.1, 0.06), (0.0, 0.03, 0.09), (0.0, 0.3, 0.035), (0, 0.25, 0.03), (0, 0.2, 0.03)]
JOINTS = [(0.12, 0, "0 0 1"), (0.06, 0.02, "0 1 0"), (0.32, 0, "0 1 0"), (0.27, 0, "1 0 0")]


def write_arm(folder):
    parts = []
    for index, (low, height, half) in enumerate(BOXES):
        corners = np.array(np.meshgrid([-half, half], [-half, half], [low, low + height]))
        corners = corners.reshape(3, 8).T
        faces = ConvexHull(corners).simplices + 1
        lines = ["v {} {} {}".format(*one) for one in corners]
        lines += ["f {} {} {}".format(*one) for one in faces]
        (folder / f"l{index}.obj").write_text("\n".join(lines) + "\n")
        parts.append(LINK.format(index))
    parts += [
        JOINT.format(index, index + 1, height, across, axis)
        for index, (height, across, axis) in enumerate(JOINTS)
    ]
    path = folder / "boxes.urdf"
    path.write_text(f'<robot name="boxes">{"".join(parts)}</robot>')
    return path


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = add_robot(write_arm(tmp_path_factory.mktemp("arm")))
    robot = load_robot(path)
    tree, urdf = read_robot_urdf(load_config(path, RobotConfig), path)
    return robot, collision_shapes(robot.model, tree, urdf)


def touching_meshes(robot, shapes, poses):
    """Poses in which any two links that are no neighbours touch, by Pinocchio's own collisions."""
    model, geometry = robot.model, pinocchio.GeometryModel()
    for link, joint, pose, shape, _ in shapes:
        geometry.addGeometryObject(pinocchio.GeometryObject(link, joint + 1, 0, pose, shape))
    for first in range(len(shapes)):
        for second in range(first + 1, len(shapes)):
            if abs(shapes[first][1] - shapes[second][1]) > 1:
                geometry.addCollisionPair(pinocchio.CollisionPair(first, second))
    data, placed = model.createData(), geometry.createData()
    return np.array(
        [pinocchio.computeCollisions(model, data, geometry, placed, pose, True) for pose in poses]
    )


def test_no_pose_whose_meshes_touch_is_called_clear_and_few_others_are_lost(arm):
    robot, shapes = arm
    poses = random_poses(robot, 1000, seed=17)
    touching = touching_meshes(robot, shapes, poses)
    clear = ~pair_overlaps(robot, poses).any(axis=1)
    assert 50 < touching.sum() < 900
    # The column below the base is no mesh.
    assert not np.any(clear & touching)
    assert np.sum(clear) > 0.5 * np.sum(~touching)


def test_a_pair_that_always_overlaps_makes_no_arm_useless(arm):
    robot, _ = arm
    assert always_overlapping(robot) == []


def test_without_meshes_capsules_that_always_overlap_are_left_out(tmp_path):
    text = write_arm(tmp_path).read_text()
    for index in range(len(BOXES)):
        text = text.replace(f'<mesh filename="l{index}.obj"/>', '<sphere radius="0.16"/>')
    urdf = tmp_path / "balls.urdf"
    urdf.write_text(text.replace('name="boxes"', 'name="balls"'))
    robot = load_robot(add_robot(urdf))
    assert always_overlapping(robot) == []
    config = load_config(tmp_path / "balls.yaml", RobotConfig)
    assert ("l0", "l2") in config.ignored_pairs
    assert any("ignored pair l0, l2" in one for one in config.assumed)


def test_meshes_that_touch_only_sometimes_are_kept(arm):
    robot, shapes = arm
    touch = mesh_contacts(robot.model, [one[:4] for one in shapes])
    poses = random_poses(robot, 400, seed=3)
    assert touch("l0", "no", poses, 0.0) is None
    touched, looked = touch("l0", "l3", poses, 0.0)
    # It stops as soon as both have been seen.
    assert 0 < touched <= looked <= 400
    pairs, notes = find_ignored_pairs(robot, lambda *_: (1, 2))
    assert (pairs, notes) == ([], [])
    assert Path(robot.source).name == "boxes.yaml"


def test_a_capsule_whose_pairs_overlap_together_is_left_out():
    """The first capsule lies beside the joint: near both parts of the other link, touching none."""
    parts = np.array([[0, 2], [0, 3], [1, 2], [1, 3]])
    overlaps = np.zeros((100, 4), dtype=bool)
    overlaps[:50, :2] = True
    overlaps[50:60] = True
    touching = np.arange(100) // 5 == 11
    found = capsules_that_say_nothing(parts, overlaps, lambda some: not touching[some].any())
    assert sorted(found) == [0, 1]


@pytest.mark.parametrize("seed", range(20))
def test_what_touches_overlaps_by_what_is_kept(seed):
    random = np.random.default_rng(seed)
    parts = np.array([(one, other) for one in range(3) for other in range(3, 6)])
    overlaps = random.random((300, 9)) < random.random(9) * 0.4
    touching = (overlaps[:, random.choice(9, 3)] & (random.random((300, 3)) < 0.3)).any(axis=1)
    before = [int(random.integers(9))]
    kept = np.setdiff1d(range(9), before)
    touching &= overlaps[:, kept].any(axis=1)
    found = capsules_that_say_nothing(
        parts, overlaps, lambda some: not touching[some].any(), before
    )
    assert set(before) <= set(found)
    assert len(set(found)) == len(found)
    kept = np.setdiff1d(range(9), found)
    assert not np.any(touching & ~overlaps[:, kept].any(axis=1))
