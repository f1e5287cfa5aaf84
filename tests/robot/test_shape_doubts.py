"""Capsules against meshes, pairs that always touch, the flange's axis."""

import numpy as np
import pytest
import yaml

from besman.robot.description_faults import check_robot
from besman.robot.model import find_robot, load_robot
from besman.robot.new_robot import add_robot
from besman.robot.shape_doubts import distance_outside

BOX = '<box size="0.06 0.06 0.3"/>'


def write_arm(folder, *, spread=0.4):
    """Write an arm of five links in a row whose boxes overlap unless they are spread."""
    links = [
        f'<link name="l{k}"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" '
        f'iyy="0.01" iyz="0" izz="0.01"/></inertial><collision><origin xyz="0 0 0.15"/>'
        f"<geometry>{BOX}</geometry></collision></link>"
        for k in range(5)
    ]
    joints = [
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 {spread}"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
        '<limit lower="-0.2" upper="0.2" effort="9" velocity="2"/></joint>'
        for k in range(4)
    ]
    path = folder / "row.urdf"
    path.write_text(f'<robot name="row">{"".join(links)}{"".join(joints)}</robot>')
    return path


def changed(folder, **changes):
    """Write a UR5 with other content under another name."""
    content = yaml.safe_load(find_robot("ur5").read_text())
    for key, change in changes.items():
        content[key] = change(content.get(key))
    content["name"] = "own"
    path = folder / "own.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def doubtful(path):
    return [one.text for one in check_robot(path) if one.kind == "doubtful"]


def test_points_outside_are_as_far_as_by_sampling_the_axis():
    random = np.random.default_rng(0)
    points, ends = random.normal(size=(40, 3)), random.normal(size=(3, 2, 3))
    radii = np.array([0.1, 0.3, 0.2])
    axes = [a + s * (b - a) for a, b in ends for s in np.linspace(0, 1, 4001)[:, None]]
    samples = np.array(axes).reshape(3, -1, 3)
    gaps = np.linalg.norm(samples[None] - points[:, None, None], axis=-1).min(axis=2) - radii
    np.testing.assert_allclose(distance_outside(points, ends, radii), gaps.min(1), atol=1e-5)


def test_the_robots_that_come_along_have_no_doubts_about_their_shapes():
    assert not [text for text in doubtful("ur5") if "capsules of" in text or "flange" in text]


def test_a_mesh_that_stands_out_of_its_capsule_is_named(tmp_path):
    robot = load_robot("ur5")
    row = robot.chain.capsule_links.index("forearm_link")
    ends, radius = robot.chain.capsule_ends[row].tolist(), float(robot.chain.capsule_radii[row])

    def thin(_):
        return [{"link": "forearm_link", "ends_m": ends, "radius_m": radius / 2}]

    found = doubtful(changed(tmp_path, capsules=thin))
    assert any("capsules of link forearm_link: its mesh stands out by" in text for text in found)

    def thick(_):
        return [{"link": "forearm_link", "ends_m": ends, "radius_m": 0.5}]

    found = doubtful(changed(tmp_path, capsules=thick))
    assert any("forearm_link: they reach" in text and "beyond its mesh" in text for text in found)


def test_pairs_that_overlap_in_every_pose_are_named(tmp_path):
    path = add_robot(write_arm(tmp_path))
    assert not [text for text in doubtful(path) if "overlap" in text]
    content = yaml.safe_load(path.read_text())
    for capsule in content["capsules"]:
        capsule["radius_m"] = 0.45
    path.write_text(yaml.safe_dump(content))
    assert any(
        text.startswith("links l0, l2: their capsules overlap in every pose")
        for text in doubtful(path)
    )


@pytest.mark.parametrize(("quaternion", "degrees"), [([0, 1, 0, 0], 180), ([1, 1, 0, 0], 90)])
def test_a_flange_that_looks_elsewhere_is_said(tmp_path, quaternion, degrees):
    path = changed(tmp_path, flange_wxyz=lambda _: quaternion)
    assert any(
        f"is {degrees} degrees off the last axis away from the arm" in text
        for text in doubtful(path)
    )


def test_limits_beyond_what_the_maker_publishes_are_said(tmp_path):
    def faster(joints):
        joints[1]["velocity_deg_s"], joints[2]["torque_nm"] = 181.0, 300.0
        return joints

    found = doubtful(changed(tmp_path, joints=faster))
    (said,) = [text for text in found if "more than published of Universal Robots UR5" in text]
    assert said.startswith("torque_nm: ")
    assert "elbow_joint 300 over 150" in said
