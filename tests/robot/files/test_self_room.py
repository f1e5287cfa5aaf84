"""Room beside itself: links that enclose each other, and what is said of those that leave none."""

import numpy as np
import pytest

from besman.config.yaml_file import load_config
from besman.robot.collision import distances
from besman.robot.config import RobotConfig
from besman.robot.files import self_room
from besman.robot.files.link_pieces import sticking_out, whole_surface
from besman.robot.files.surface_contacts import (
    meeting_regions,
    parts_contacts,
    surface_mesh,
    surfaces_meet,
)
from besman.robot.files.touching_links import mesh_contacts, random_poses
from besman.robot.link_shapes import collision_shapes, link_surfaces
from besman.robot.model import load_robot, read_robot_urdf
from besman.robot.new_robot import add_robot

JOINT = """<joint name="NAME" type="revolute"><parent link="PARENT"/><child link="CHILD"/>
<origin xyz="AT"/><axis xyz="AXIS"/><limit lower="-2.6" upper="2.6" effort="9" velocity="2"/>
</joint>"""

# A tub whose walls the third link, which turns inside of it, meets in some poses: the capsules
# around tub and link overlap in every one.
WALLS = [("0.3 0 0.15", "0.02 0.6 0.3"), ("-0.3 0 0.15", "0.02 0.6 0.3"),
         ("0 0.3 0.15", "0.6 0.02 0.3"), ("0 -0.3 0.15", "0.6 0.02 0.3"),
         ("0 0 0", "0.6 0.6 0.02")]  # fmt: skip
BEAM = """<link name="NAME"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 HALF"/><geometry><box size="0.06 0.06 LENGTH"/></geometry></collision>
</link>"""


def write_tub(folder):
    walls = [
        f'<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
        for at, size in WALLS
    ]
    parts = [f'<link name="tub">{"".join(walls)}</link>']
    for name, length in (("p", 0.08), ("q", 0.45), ("r", 0.2), ("s", 0.1)):
        parts.append(
            BEAM.replace("NAME", name)
            .replace("HALF", str(length / 2))
            .replace("LENGTH", str(length))
        )
    for name, parent, child, at, axis in (
        ("a", "tub", "p", "0 0 0.03", "0 0 1"), ("b", "p", "q", "0 0 0.1", "0 1 0"),
        ("c", "q", "r", "0 0 0.5", "0 1 0"), ("d", "r", "s", "0 0 0.25", "1 0 0"),
    ):  # fmt: skip
        joint = JOINT.replace("NAME", name).replace("PARENT", parent).replace("CHILD", child)
        parts.append(joint.replace("AT", at).replace("AXIS", axis))
    path = folder / "tub.urdf"
    path.write_text(f'<robot name="tub">{"".join(parts)}</robot>')
    return path


@pytest.fixture(scope="module")
def tub(tmp_path_factory):
    """The arm in a tub as it came in, its surfaces, and its meshes' contacts."""
    path = add_robot(write_tub(tmp_path_factory.mktemp("tub")))
    robot = load_robot(path)
    tree, urdf = read_robot_urdf(load_config(path, RobotConfig), path)
    shapes = collision_shapes(robot.model, tree, urdf)
    return robot, link_surfaces(shapes), mesh_contacts(robot.model, [one[:4] for one in shapes])


def test_links_that_enclose_each_other_leave_room(tub):
    robot, _, contacts = tub
    poses = random_poses(robot, 300, seed=7)
    pairs = [("tub", "q"), ("tub", "r"), ("p", "r"), ("tub", "s"), ("p", "s"), ("q", "s")]
    touching, near = (
        np.array([any(contacts(*pair, pose[None], margin)[0] for pair in pairs) for pose in poses])
        for margin in (0.0, 0.01)
    )
    clear = distances(robot.chain, poses)[:, 0] > 0
    assert touching.sum() > 30
    assert not np.any(clear & touching)
    assert np.mean(~clear[~near]) < 0.15


def test_links_touch_where_surfaces_of_two_capsules_do(tub):
    robot, surfaces, contacts = tub
    chain = robot.chain
    links = np.array(chain.capsule_links)
    owners = {}
    for link in ("tub", "q"):
        mine = np.flatnonzero(links == link)
        held = [(chain.capsule_ends[at], chain.capsule_radii[at]) for at in mine]
        owners[link] = np.argmin(sticking_out(held, *whole_surface(link, surfaces)), axis=0)
    meet = parts_contacts(robot, surfaces, owners)
    ends = [np.flatnonzero(links == link) for link in ("tub", "q")]
    found = []
    for pose in random_poses(robot, 30, seed=3)[:, None]:
        parts = any(meet(int(a), int(b), pose, 0.0) for a in ends[0] for b in ends[1])
        assert parts == bool(contacts("tub", "q", pose, 0.0)[0])
        found.append(parts)
    assert 0 < sum(found) < len(found)
    # Of a link that has no surface nothing is known.
    assert meet(int(np.flatnonzero(links == "pedestal")[0]), int(ends[1][0]), pose, 0.0)


def test_regions_meet_where_single_triangles_do(tub):
    robot, surfaces, _ = tub
    by_link = {link: (joint, *rest) for link, joint, *rest in surfaces}
    sides = by_link["tub"], by_link["q"]
    poses = random_poses(robot, 12, seed=5)
    labels = [np.arange(len(side[2])) for side in sides]
    met = meeting_regions(robot.model, sides, labels, poses, 0.003, len(poses))
    for first, second in np.ndindex(met.shape):
        alone = [
            (joint, surface_mesh(vertices[triangles[one]], np.array([[0, 1, 2]])))
            for (joint, vertices, triangles), one in zip(sides, (first, second), strict=True)
        ]
        assert met[first, second] == surfaces_meet(robot.model, alone, poses, 0.003)
    assert 0 < met.sum() < met.size


def test_a_pair_that_leaves_no_pose_clear_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(self_room.fitted_shapes, "carve", lambda capsules, *_: (capsules, {}))
    path = add_robot(write_tub(tmp_path))
    assert (
        "links tub, q: their capsules overlap in every pose, so that none is clear; their meshes "
        "do not; name the pair under ignored_pairs if it cannot touch"
    ) in load_config(path, RobotConfig).assumed


# A drum that turns off its middle beside a box: it scrapes it in some poses, and is near in all.
DRUM = """<robot name="drum"><link name="box"><collision><origin xyz="0.2045 0 0.1"/>
<geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="p"/><link name="q"><collision><origin xyz="0.005 0 0.1"/>
<geometry><cylinder radius="0.1" length="0.2"/></geometry></collision></link>
<link name="r"><collision><origin xyz="0 0 0.1"/>
<geometry><cylinder radius="0.03" length="0.2"/></geometry></collision></link>JOINTS</robot>"""


def test_meshes_that_are_near_in_every_pose_are_said(tmp_path):
    joints = [
        JOINT.replace("NAME", name).replace("PARENT", parent).replace("CHILD", child)
        .replace("AT", at).replace("AXIS", axis)
        for name, parent, child, at, axis in (
            ("a", "box", "p", "0 0 0", "0 0 1"),
            ("b", "p", "q", "0 0 0", "0 0 1"),
            ("c", "q", "r", "0 0 0.3", "0 1 0"),
        )
    ]  # fmt: skip
    file = tmp_path / "drum.urdf"
    file.write_text(DRUM.replace("JOINTS", "".join(joints)))
    assert (
        "links box, q: their capsules overlap in every pose, so that none is clear; their meshes "
        "come within 1 cm in every pose too: look at the origins and the scale of their meshes"
    ) in load_config(add_robot(file), RobotConfig).assumed
