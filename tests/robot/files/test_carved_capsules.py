"""Capsules that are split where they cost room still enclose what they did."""

import numpy as np
import pytest

from besman.config.yaml_file import load_config
from besman.robot.capsules import distances_to_axis, subdivide
from besman.robot.collision import distances
from besman.robot.config import RobotConfig
from besman.robot.files import carved_capsules
from besman.robot.files.carved_capsules import carve_capsules
from besman.robot.files.touching_links import link_pairs, mesh_contacts, random_poses
from besman.robot.link_shapes import collision_shapes, link_surfaces
from besman.robot.model import load_robot, read_robot_urdf
from besman.robot.new_robot import add_robot

# Broad and flat, as housings are: a capsule around one is thicker than it by 15 cm.
LINK = """<link name="NAME"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.15"/><geometry>SHAPE</geometry></collision></link>"""
JOINT = """<joint name="NAME" type="revolute"><parent link="PARENT"/><child link="CHILD"/>
<origin xyz="0 0 0.32"/><axis xyz="0 1 0"/><limit lower="-2.6" upper="2.6" effort="9" velocity="2"/>
</joint>"""
PLATE = '<box size="0.04 0.3 0.3"/>'


def write_arm(folder, shape=PLATE):
    parts = [LINK.replace("NAME", name).replace("SHAPE", shape) for name in "pqrs"]
    for name, (parent, child) in {"a": "pq", "b": "qr", "c": "rs"}.items():
        joint = JOINT.replace("NAME", name).replace("PARENT", parent)
        parts.append(joint.replace("CHILD", child))
    path = folder / "plates.urdf"
    path.write_text(f'<robot name="plates">{"".join(parts)}</robot>')
    return path


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """The arm with whole capsules, its surfaces, its meshes' contacts and the capsules carved."""
    folder = tmp_path_factory.mktemp("plates")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(carved_capsules, "carve_capsules", lambda *_: {})
        path = add_robot(write_arm(folder), name="whole")
    robot = load_robot(path)
    tree, urdf = read_robot_urdf(load_config(path, RobotConfig), path)
    surfaces = link_surfaces(collision_shapes(robot.model, tree, urdf))
    shapes = [one[:4] for one in collision_shapes(robot.model, tree, urdf)]
    contacts = mesh_contacts(robot.model, shapes)
    return robot, surfaces, contacts, load_robot(add_robot(folder / "plates.urdf", name="carved"))


def test_every_triangle_is_wholly_in_a_capsule(plates):
    robot, surfaces, contacts, _ = plates
    carved = carve_capsules(robot, surfaces, contacts)
    assert any(found.changed for found in carved.values())
    for link, _, vertices, triangles in surfaces:
        found = carved[link]
        fine, faces = subdivide(vertices, triangles, 1 / 8)
        away = [distances_to_axis(fine, ends) - radius for ends, radius in found.capsules]
        out = np.array(away)[:, faces].max(axis=2)
        assert out[found.owner, np.arange(len(faces))].max() <= 1e-9
        assert found.changed == (len(found.capsules) > 1)
        assert len(found.capsules) <= 12


def test_the_same_arm_is_carved_alike(plates):
    robot, surfaces, contacts, _ = plates
    first, second = (carve_capsules(robot, surfaces, contacts) for _ in range(2))
    assert list(first) == list(second)
    for link, found in first.items():
        both = zip(found.capsules, second[link].capsules, strict=True)
        for (ends, radius), (others, other) in both:
            assert ends.tobytes() == others.tobytes()
            assert radius == other


def test_less_room_is_lost_and_nothing_missed(plates):
    robot, _, contacts, carved = plates
    poses = random_poses(robot, 400, seed=5)
    pairs = link_pairs(robot)
    touching, near = (
        np.array([any(contacts(*pair, pose[None], margin)[0] for pair in pairs) for pose in poses])
        for margin in (0.0, 0.01)
    )
    # The pedestal is no link.
    free = [distances(one.chain, poses)[:, 0] > 0 for one in (robot, carved)]
    lost = [float(np.mean(~clear[~near])) for clear in free]
    assert touching.sum() > 10
    assert not np.any(free[1] & touching)
    assert lost[1] < 0.7 * lost[0]
