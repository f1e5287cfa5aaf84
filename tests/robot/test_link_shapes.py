"""Shapes of links: scaled and mirrored meshes are where the URDF puts them."""

import coal
import numpy as np
import pinocchio
import pytest
from scipy.spatial import ConvexHull

from besman.pictures.arm_visuals import robot_meshes
from besman.robot.capsules import fit_capsule
from besman.robot.link_shapes import link_surfaces
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot

LINK = """<link name="NAME"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.01"/><geometry><mesh filename="box.obj" scale="SCALE"/></geometry>
</collision></link>"""
JOINT = """<joint name="NAME" type="revolute"><parent link="PARENT"/><child link="CHILD"/>
<origin xyz="0 0 0.42"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="2"/>
</joint>"""
# Millimetres, and not around the origin: a mirrored box is elsewhere.
CORNERS = np.array(np.meshgrid([0, 100], [0, 60], [0, 400])).reshape(3, 8).T


def outward_faces():
    """Triangles of the box, counted anticlockwise from outside."""
    faces = ConvexHull(CORNERS).simplices
    a, b, c = np.moveaxis(CORNERS[faces], 1, 0)
    inside = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - CORNERS.mean(axis=0)) < 0
    return np.where(inside[:, None], faces[:, ::-1], faces)


def write_arm(folder, scale):
    faces = outward_faces() + 1
    lines = ["v {} {} {}".format(*corner) for corner in CORNERS]
    lines += ["f {} {} {}".format(*face) for face in faces]
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    parts = [LINK.replace("NAME", name).replace("SCALE", scale) for name in "pqr"]
    for name, (parent, child) in {"a": "pq", "b": "qr"}.items():
        joint = JOINT.replace("NAME", name).replace("PARENT", parent)
        parts.append(joint.replace("CHILD", child))
    path = folder / "boxes.urdf"
    path.write_text(f'<robot name="boxes">{"".join(parts)}</robot>')
    return path


@pytest.mark.parametrize(
    "scale", ["0.001 0.001 0.001", "0.001 -0.001 0.001", "-0.002 0.001 -0.001", "1e-3 1e-3 5e-4"]
)
def test_scaled_and_mirrored_boxes_are_inside_their_capsules_and_drawn_where_they_are(
    tmp_path, scale
):
    factors = np.array([float(word) for word in scale.split()])
    box = CORNERS * factors + [0.0, 0.0, 0.01]
    robot = load_robot(add_robot(write_arm(tmp_path, scale), "r"))
    chain = robot.chain
    for link, joint in (("q", 0), ("r", 1)):
        index = chain.capsule_links.index(link)
        (start, end), radius = chain.capsule_ends[index], chain.capsule_radii[index]
        along = end - start
        share = np.clip((box - start) @ along / (along @ along), 0, 1)
        away = np.linalg.norm(box - start - share[:, None] * along, axis=1)
        assert away.max() <= radius + 1e-3
        assert away.max() == pytest.approx(radius, abs=0.01)
        assert radius == pytest.approx(fit_capsule(box)[1], abs=2e-3)
        drawn = [mesh for mesh in robot_meshes(robot) if mesh[0] == link]
        assert drawn[0][1] == joint
        vertices, triangles = drawn[0][2:]
        np.testing.assert_allclose(sorted(map(tuple, np.unique(vertices.round(9), axis=0))),
                                   sorted(map(tuple, box.round(9))), atol=1e-6)  # fmt: skip
        assert len(triangles) == 12


def test_a_mirrored_mesh_keeps_its_outside(tmp_path):
    volumes = []
    for scale in ("0.001 0.001 0.001", "0.001 -0.001 0.001"):
        folder = tmp_path / scale.replace(" ", "_")
        folder.mkdir()
        robot = load_robot(add_robot(write_arm(folder, scale), "r"))
        vertices, triangles = robot_meshes(robot)[0][2:]
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        volumes.append(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)
    assert volumes[0] > 0
    assert volumes[1] == pytest.approx(volumes[0])


@pytest.mark.parametrize(
    ("shape", "volume_m3"),
    [
        (coal.Cylinder(1e-9, 15.0), None),
        (coal.Cylinder(0.05, 0.0), None),
        (coal.Cylinder(5.0, 1e-7), None),
        (coal.Cylinder(0.05, 0.4), np.pi * 0.05**2 * 0.4),
        (coal.Sphere(0.0), None),
        (coal.Capsule(1e-9, 12.0), None),
        (coal.Box(1e-12, 18.0, 1e-12), None),
        (coal.Box(0.2, 0.3, 0.4), 0.024),
    ],
    ids=["needle", "no length", "plate", "cylinder", "point", "wire", "rod", "box"],
)
def test_any_primitive_has_a_closed_surface(shape, volume_m3):
    """Needles, plates and points too: Qhull has no hull of those as they are."""
    ((_, _, corners, faces),) = link_surfaces([("l", 0, pinocchio.SE3.Identity(), shape, False)])
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    if volume_m3 is not None:
        assert volume_m3 <= ConvexHull(corners[np.unique(faces)]).volume < 1.03 * volume_m3 + 1e-12
