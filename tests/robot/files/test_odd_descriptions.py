"""Descriptions that real packages ship: they come in, or one line says what is wrong."""

from itertools import pairwise

import numpy as np
import pytest
import yaml
from scipy.spatial import ConvexHull

from besman.exceptions import RobotError
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot
from besman.robot.urdf_file import read_urdf_text

LIMIT = "<limit lower='-2' upper='2' effort='9' velocity='2'/>"
MASS = "<inertial><mass value='1'/><inertia ixx='0.01' iyy='0.01' izz='0.01'/></inertial>"


def shape(geometry, origin=""):
    return f"<collision>{origin}<geometry>{geometry}</geometry></collision>"


def write(folder, shapes, below="", name="odd"):
    """Write an arm of three hinges; shapes of its second link, and what stands below its base."""
    links = {"base": "", "a": "", "b": shapes, "c": shape("<sphere radius='0.03'/>")}
    text = "".join(f"<link name='{key}'>{MASS}{one}</link>" for key, one in links.items())
    ends = ["base", "a", "b", "c"]
    for index, (parent, child) in enumerate(pairwise(ends)):
        text += (f"<joint name='j{index}' type='revolute'><parent link='{parent}'/>"
                 f"<child link='{child}'/><origin xyz='0 0 0.3'/><axis xyz='{index} 1 0'/>{LIMIT}"
                 "</joint>")  # fmt: skip
    path = folder / f"{name}.urdf"
    path.write_text(f"<robot name='{name}'>{text}{below}</robot>")
    return path


def assumed(path):
    return yaml.safe_load(path.read_text())["assumed"]


def test_a_capsule_is_a_cylinder_with_balls_at_its_ends(tmp_path):
    origin = "<origin xyz='0.1 0 0.2' rpy='0 1.5707963267948966 0'/>"
    urdf = write(tmp_path, shape("<capsule radius='0.04' length='0.2'/>", origin))
    link = read_urdf_text(urdf).find("link[@name='b']")
    assert [one[0].tag for one in link.iterfind("collision/geometry")] == [
        "cylinder", "sphere", "sphere"]  # fmt: skip
    robot = load_robot(add_robot(urdf))
    mine = [index for index, name in enumerate(robot.chain.capsule_links) if name == "b"]
    assert robot.chain.capsule_radii[mine] == pytest.approx([0.04], abs=1e-3)
    ends = robot.chain.capsule_ends[mine][0]
    np.testing.assert_allclose(sorted(ends[:, 0]), [0.0, 0.2], atol=1e-3)
    np.testing.assert_allclose(ends[:, 1:], [[0, 0.2], [0, 0.2]], atol=1e-3)


def test_a_box_of_no_size_is_no_shape_and_a_plate_is_one(tmp_path):
    nothing = shape("<box size='0 0 0'/>")
    path = add_robot(write(tmp_path, nothing))
    assert any("capsules along" in one and "b" in one for one in assumed(path))
    # With more shapes than primitives that get capsules of their own.
    plates = "".join(shape(f"<box size='0.2 0.{one} 0'/>") for one in range(1, 7))
    robot = load_robot(add_robot(write(tmp_path, nothing + plates, name="plates")))
    mine = np.array([name == "b" for name in robot.chain.capsule_links])
    ends, radii = robot.chain.capsule_ends[mine], robot.chain.capsule_radii[mine]
    corner = np.array([0.1, 0.3, 0.0])
    for sign in (-1, 1):
        along = ends[:, 1] - ends[:, 0]
        length = np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
        share = np.clip(np.einsum("ij,ij->i", sign * corner - ends[:, 0], along) / length, 0, 1)
        away = np.linalg.norm(ends[:, 0] + share[:, None] * along - sign * corner, axis=1)
        assert np.min(away - radii) <= 1e-4


def box_mesh(path, faces=None):
    """Write a box of 100 x 100 x 300 mm as STL, some of its triangles."""
    corners = np.array(np.meshgrid([0, 0.1], [0, 0.1], [0, 0.3])).reshape(3, 8).T
    triangles = ConvexHull(corners).simplices[:faces]
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows = np.zeros(len(triangles), dtype=record)
    rows["corners"] = corners[triangles]
    path.write_bytes(b"\0" * 80 + len(rows).to_bytes(4, "little") + rows.tobytes())


def test_a_mesh_that_is_not_watertight_is_enclosed(tmp_path):
    box_mesh(tmp_path / "open.stl", faces=9)
    robot = load_robot(add_robot(write(tmp_path, shape("<mesh filename='open.stl'/>"))))
    mine = [index for index, name in enumerate(robot.chain.capsule_links) if name == "b"]
    assert mine
    # Its hull, as that of the whole box: a side is missing, no corner is.
    ends, radii = robot.chain.capsule_ends[mine], robot.chain.capsule_radii[mine]
    assert np.all(radii < 0.15)
    assert np.abs(ends).max() < 0.35


def test_a_mesh_of_100_megabytes_is_left_out_and_said(tmp_path):
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(100_000_000)
    path = add_robot(write(tmp_path, shape("<mesh filename='huge.stl'/>")))
    assert f"mesh {tmp_path / 'huge.stl'}: 100 MB, more than 40" in assumed(path)
    assert any(one.startswith("capsules along a, b") for one in assumed(path))


def test_a_base_that_floats_or_drives_is_fixed_and_said(tmp_path):
    below = ("<link name='world'/><joint name='drive' type='{}'><parent link='world'/>"
             "<child link='base'/><origin xyz='0 0 0.1'/></joint>")  # fmt: skip
    plain = load_robot(add_robot(write(tmp_path, "", name="plain"), base="base"))
    pose = np.array([0.3, -0.4, 0.5])
    wanted = forward_kinematics(plain.chain, pose)[:3, 3] - [0, 0, plain.base_height]
    for kind in ("planar", "floating"):
        path = add_robot(write(tmp_path, "", below.format(kind), kind), base="base")
        assert f"joint drive is {kind}: it is fixed" in assumed(path)
        robot = load_robot(path)
        found = forward_kinematics(robot.chain, pose)[:3, 3] - [0, 0, robot.base_height + 0.1]
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_what_is_wrong_with_a_mjcf_is_said_of_the_users_file(tmp_path):
    arm = ("<body name='{0}{1}' pos='0 0 0.1'><joint name='{0}j{1}' axis='0 1 0' range='-1 1'/>"
           "<geom size='0.02'/>{2}</body>")  # fmt: skip
    rows = {"left": "", "right": ""}
    for side in rows:
        for index in range(5, 0, -1):
            rows[side] = arm.format(side, index, rows[side])
    file = tmp_path / "two.xml"
    file.write_text(
        f"<mujoco model='two'><worldbody>{rows['left']}{rows['right']}</worldbody></mujoco>"
    )
    with pytest.raises(RobotError, match=r"two\.xml: tip: more than one chain.*--tip left5 \(5 h"):
        add_robot(file, folder=tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["two.xml"]


@pytest.mark.parametrize(
    ("inertial", "mass", "moments"),
    [
        ("<mass value=' 2 '/><inertia ixx='0.1' iyy='0.2' izz='0.3'/>", 2, (0.1, 0.2, 0.3)),
        ("<mass value='2'/>", 2, (0, 0, 0)),
        ("<inertia ixx='0.1' iyy='0.2' izz='0.3'/>", None, None),
        ("", None, None),
    ],
)
def test_a_link_with_half_an_inertial_keeps_its_shapes_and_its_mass(
    tmp_path, inertial, mass, moments
):
    ball = "<visual/><visual><geometry/></visual>" + shape("<sphere radius='0.05'/>")
    urdf = write(tmp_path, ball)
    half = f"<link name='b'><inertial>{inertial}</inertial>"
    urdf.write_text(urdf.read_text().replace(f"<link name='b'>{MASS}", half))
    robot = load_robot(add_robot(urdf))
    assert "b" in robot.chain.capsule_links
    if mass is not None:
        assert robot.model.inertias[2].mass == pytest.approx(mass)
        np.testing.assert_allclose(robot.model.inertias[2].inertia, np.diag(moments), atol=1e-12)


def test_what_a_library_loses_of_a_link_is_refused(tmp_path):
    urdf = write(tmp_path, shape("<cylinder radius='0.05'/>"))
    with pytest.raises(RobotError, match=r"odd\.urdf: cannot be used as URDF: .*length") as caught:
        add_robot(urdf)
    assert "\n" not in str(caught.value)
    assert [one.name for one in tmp_path.iterdir()] == ["odd.urdf"]


def test_a_shoulder_on_the_base_does_not_touch_what_the_arm_stands_on(tmp_path):
    urdf = write(tmp_path, shape("<cylinder radius='0.05' length='0.2'/>"))
    low = urdf.read_text().replace("<origin xyz='0 0 0.3'/><axis xyz='0", "<axis xyz='0")
    urdf.write_text(low.replace("<origin xyz='0 0 0.3'/><axis xyz='1", "<axis xyz='1"))
    path = add_robot(urdf)
    content = yaml.safe_load(path.read_text())
    assert content["mounting"]["pedestal_radius_m"] > 0
    assert ["b", "pedestal"] in content["ignored_pairs"]
    assert "ignored pair b, pedestal: they overlap in every pose" in content["assumed"]
    assert "home: found by a search" in content["assumed"]
