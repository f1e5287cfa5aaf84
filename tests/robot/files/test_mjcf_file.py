"""MJCF: what comes in is what MuJoCo computes with."""

import mujoco
import numpy as np
import pytest
import yaml

from besman.exceptions import RobotError
from besman.robot.dynamics import inverse_dynamics
from besman.robot.files.mjcf_file import is_mjcf, read_mjcf
from besman.robot.files.mjcf_meshes import compile_bare
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot

BODY = '<inertial pos="0.01 0 0.1" mass="{0}" diaginertia="0.02 0.03 0.01" quat="1 0.2 0 0.1"/>'
ARM = f"""<mujoco model="bench"><compiler angle="radian" autolimits="true" meshdir="parts"/>
<asset><mesh name="rock" file="rock.obj" scale="0.001 -0.001 0.001"/></asset>
<worldbody><geom type="plane" size="2 2 1"/>
<body name="ball" pos="1 0 1"><freejoint/><geom type="sphere" size="0.1"/></body>
<body name="foot" pos="0.3 -0.1 0.4" euler="0 0 0.5">{BODY.format(2)}
 <geom type="box" size="0.1 0.1 0.05"/>
 <body name="upper" pos="0 0 0.2" euler="0.1 0.2 0"><joint name="a" axis="0 1 0" pos="0.02 0 0.05"
   range="-2 2" actuatorfrcrange="-70 70"/>
  <joint name="b" axis="0 0 1" range="-1.5 2.5" ref="0.4" damping="0.3"/>{BODY.format(3)}
  <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.05" contype="0" conaffinity="0"/>
  <body name="fore" pos="0 0.02 0.4"><joint name="c" axis="1 1 0" range="-2 2"/>{BODY.format(2)}
   <geom type="mesh" mesh="rock"/>
   <body name="wrist" pos="0 0 0.3"><joint name="d" axis="0 0 1" range="-3 3"/>{BODY.format(1)}
    <geom type="cylinder" size="0.03 0.05"/><site name="attachment_site" pos="0 0 0.1"/>
    <body name="left"><joint name="grip" type="slide" axis="0 1 0" range="0 0.04"/>
     {BODY.format(0.1)}<geom type="sphere" size="0.01"/></body>
    <body name="right"><joint name="follow" type="slide" axis="0 -1 0" range="0 0.04"/>
     {BODY.format(0.1)}<geom type="sphere" size="0.01"/></body>
</body></body></body></body></worldbody>
<equality><joint joint1="follow" joint2="grip" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="a" forcerange="-5 5"/><motor joint="b" forcerange="-30 20" gear="2"/>
<motor joint="c" ctrlrange="-1 1" gear="40"/></actuator>
<keyframe><key name="home" qpos="1 0 1 1 0 0 0 0.3 0.5 1.2 0.1 0 0"/></keyframe></mujoco>"""
NAMES = ["a", "b", "c", "d"]


def write(folder, text=ARM):
    (folder / "parts").mkdir()
    corners = np.array(np.meshgrid([-30, 30], [-20, 50], [0, 200])).reshape(3, 8).T
    lines = ["v {} {} {}".format(*one) for one in corners]
    lines += ["f 1 2 3", "f 3 2 4", "f 5 7 6", "f 6 7 8", "f 1 5 2", "f 2 5 6", "f 3 4 7",
              "f 7 4 8", "f 1 3 5", "f 5 3 7", "f 2 6 4", "f 4 6 8"]  # fmt: skip
    (folder / "parts" / "rock.obj").write_text("\n".join(lines) + "\n")
    path = folder / "bench.xml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = write(tmp_path_factory.mktemp("mjcf"))
    added = add_robot(path)
    return mujoco.MjModel.from_xml_path(str(path)), load_robot(added), added


def test_kinematics_and_weights_are_mujocos(arm):
    model, robot, _ = arm
    data = mujoco.MjData(model)
    assert robot.joint_names == tuple(NAMES)
    poses = np.random.default_rng(0).uniform(-1.4, 1.9, (50, 4))
    tips = forward_kinematics(robot.chain, poses)
    weights = inverse_dynamics(robot, poses, 0 * poses, 0 * poses)
    for pose, tip, weight in zip(poses, tips, weights, strict=True):
        data.qpos[[model.joint(name).qposadr[0] for name in NAMES]] = pose
        mujoco.mj_forward(model, data)
        site = data.site("attachment_site")
        place = site.xpos + np.array([0, 0, robot.base_height])
        np.testing.assert_allclose(tip[:3, 3], place, atol=1e-9)
        np.testing.assert_allclose(tip[:3, :3], site.xmat.reshape(3, 3), atol=1e-9)
        bias = data.qfrc_bias[[model.joint(name).dofadr[0] for name in NAMES]]
        np.testing.assert_allclose(weight, bias, atol=1e-6)


def test_limits_efforts_and_home_are_those_of_the_file(arm):
    model, robot, path = arm
    ranges = np.array([model.joint(name).range for name in NAMES])
    np.testing.assert_allclose(robot.limits.position_min, ranges[:, 0], atol=1e-7)
    np.testing.assert_allclose(robot.limits.position_max, ranges[:, 1], atol=1e-7)
    # actuatorfrcrange before forcerange; gear times force; gear times control; none at all.
    np.testing.assert_allclose(robot.limits.torque[:3], [70, 60, 40])
    content = yaml.safe_load(path.read_text())
    assert any(one.startswith("torque of d: ") for one in content["assumed"])
    np.testing.assert_allclose(robot.home, [0.3, 0.5, 1.2, 0.1], atol=1e-7)
    assert not any(one.startswith("home") for one in content["assumed"])
    assert "1 bodies that lie loose are left out" in content["assumed"]
    assert content["tip"] == "attachment_site"


def test_meshes_are_where_mujoco_has_them(arm):
    model, robot, _ = arm
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    (geom,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    placed = model.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    pose = np.linalg.inv(_frames(robot, 2))
    local = (placed + np.array([0, 0, robot.base_height])) @ pose[:3, :3].T + pose[:3, 3]
    inside = np.zeros(len(local), dtype=bool)
    for link, ends, radius in zip(
        robot.chain.capsule_links, robot.chain.capsule_ends, robot.chain.capsule_radii, strict=True
    ):
        if link == "fore":
            along = ends[1] - ends[0]
            share = np.clip((local - ends[0]) @ along / max(along @ along, 1e-12), 0, 1)
            inside |= np.linalg.norm(local - ends[0] - share[:, None] * along, axis=1) < radius
    assert inside.all()


def _frames(robot, joint):
    """Pose of a joint's frame at home, by Pinocchio."""
    import pinocchio

    data = robot.model.createData()
    pinocchio.forwardKinematics(robot.model, data, robot.home)
    return data.oMi[joint + 1].homogeneous


def test_a_home_that_touches_is_not_taken(tmp_path):
    text = ARM.replace("1 0 1 1 0 0 0 0.3 0.5 1.2 0.1", "1 0 1 1 0 0 0 2.5 0.5 1.2 0.1")
    content = yaml.safe_load(add_robot(write(tmp_path, text)).read_text())
    assert any(one.startswith("home: found by a search") for one in content["assumed"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<worldbody>", '<include file="../other.xml"/><worldbody>'), "other.xml' is outside"),
        (('file="rock.obj"', 'file="../../rock.obj"'), "rock.obj' is outside"),
        (('meshdir="parts"', 'meshdir="/usr"'), "/usr/rock.obj' is outside"),
        (("<mujoco model", "<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco model"), "entities are not"),
        (("<worldbody>", "<worldbody><geom type='mesh'/>"), "cannot be used as MJCF: "),
        (("<worldbody>", "<worldbody"), "not valid XML"),
    ],
)
def test_a_mjcf_that_cannot_be_used_leaves_nothing_behind(tmp_path, change, message):
    path = write(tmp_path, ARM.replace(*change, 1))
    with pytest.raises(RobotError, match=message) as caught:
        add_robot(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["bench.xml", "parts"]


@pytest.mark.parametrize(
    ("name", "note", "count"),
    [
        ("none.obj", "mesh none.obj: no such file in ", 0),
        ("Rock.OBJ", "mesh Rock.OBJ: rock.obj is taken for it", 1),
    ],
)
def test_without_a_mesh_an_arm_comes_in_as_far_as_it_is_there(tmp_path, name, note, count):
    path = write(tmp_path, ARM.replace("rock.obj", name, 1))
    model, notes = compile_bare(path)
    assert (len(notes), model.nmesh) == (1, count)
    compiled = read_mjcf(path)
    assert sum(one.startswith(note) for one in compiled.notes) == 1
    assert len(compiled.meshes) == count
    content = yaml.safe_load(add_robot(path).read_text())
    assert any(one.startswith(note) for one in content["assumed"])


def test_a_mesh_that_is_a_link_to_elsewhere_is_not_taken(tmp_path):
    path = write(tmp_path, ARM.replace("rock.obj", "other.obj", 1))
    away = tmp_path / "away.obj"
    (tmp_path / "parts" / "rock.obj").rename(away)
    (tmp_path / "parts" / "OTHER.obj").symlink_to(away)
    assert not read_mjcf(path).meshes


def test_meshes_of_the_package_are_read_and_others_where_they_may_be(tmp_path):
    package = tmp_path / "maker" / "mjcf" / "bench"
    package.mkdir(parents=True)
    path = write(package, ARM.replace('meshdir="parts"', 'meshdir="../../meshes/bench"', 1))
    meshes = tmp_path / "maker" / "meshes"
    meshes.mkdir()
    (package / "parts").rename(meshes / "bench")
    assert any(name for name in read_mjcf(path).meshes)
    elsewhere = tmp_path / "elsewhere"
    meshes.rename(elsewhere)
    path.write_text(path.read_text().replace("../../meshes", "../../../elsewhere"))
    with pytest.raises(RobotError, match=r"is outside .*maker; .*--package NAME=FOLDER"):
        read_mjcf(path)
    assert add_robot(path, packages={"parts": elsewhere}).is_file()


def test_pictures_are_not_read(tmp_path):
    pictures = ('<asset><texture name="wood" type="2d" file="../../wood.png"/><material name="m" '
                'texture="wood"/><skin file="cloth.skn"/>')  # fmt: skip
    text = ARM.replace("<asset>", pictures, 1).replace('size="0.1 0.1 0.05"', "\\g", 1)
    text = text.replace("\\g", 'size="0.1 0.1 0.05" material="m"')
    model, notes = compile_bare(write(tmp_path, text))
    assert (model.ntex, model.nmesh, notes) == (0, 1, [])


def test_a_scene_reads_what_was_installed_with_it(tmp_path, monkeypatch):
    scenes = tmp_path / "maker" / "assets" / "scenes" / "bench"
    scenes.mkdir(parents=True)
    (tmp_path / "maker" / "assets" / "parts").mkdir()
    arm = write(scenes, ARM.replace('"rock.obj"', '"../../../parts/rock.obj"', 1))
    (scenes / "parts" / "rock.obj").rename(tmp_path / "maker" / "assets" / "parts" / "rock.obj")
    outer = scenes.parent / "outer.xml"
    outer.write_text('<mujoco><include file="bench/bench.xml"/></mujoco>')
    with pytest.raises(RobotError, match=r"rock\.obj' is outside .*scenes"):
        read_mjcf(outer)
    (tmp_path / "maker-1.0.dist-info").mkdir()
    assert read_mjcf(arm).meshes
    assert read_mjcf(outer).parts == ["bench"]
    # Of what an included file names, whether or not the path is relative.
    monkeypatch.chdir(scenes.parent)
    assert set(read_mjcf(outer.relative_to(scenes.parent)).meshes) == set(read_mjcf(outer).meshes)


def test_motors_tell_speeds_and_torques(tmp_path):
    motors = ('<motor jointinparent="a" ctrlrange="-8 8" gear="2"/>'
              '<velocity joint="b" kv="50" ctrlrange="-2 3"/><position joint="c" kp="9" kv="2" '
              'ctrlrange="-1 1"/>')  # fmt: skip
    head, tail = ARM.split("<actuator>")[0], ARM.split("</actuator>")[1]
    text = f"{head}<actuator>{motors}</actuator>{tail}".replace('actuatorfrcrange="-70 70"', "")
    limits = {
        joint.get("name"): joint.find("limit").attrib
        for joint in read_mjcf(write(tmp_path, text)).tree.findall("joint")
        if joint.find("limit") is not None
    }
    given = [[float(limits[key][one]) for one in ("velocity", "effort")] for key in "abcd"]
    assert given == [[0, 16], [3, 0], [0, 0], [0, 0]]


def nested(name, hinges):
    """Bodies in a row, each on a hinge of its own."""
    text = f'<body name="{name}{hinges}" pos="0 0 0.2"><joint/><geom size="0.05"/>'
    return text + (nested(name, hinges - 1) if hinges > 1 else "") + "</body>"


def test_what_slides_beside_a_robot_is_a_thing(tmp_path):
    path = tmp_path / "scene.xml"
    puck = '<body name="puck"><joint name="x" type="slide"/><geom size="0.1"/></body>'
    for arm, kept in ((nested("a", 4), False), ("", True)):
        path.write_text(f"<mujoco><worldbody>{puck}{arm}</worldbody></mujoco>")
        found = read_mjcf(path)
        assert ("puck" in {one.get("name") for one in found.tree.findall("link")}) == kept
        assert any("lie loose" in note for note in found.notes) != kept


@pytest.mark.parametrize(
    ("standing", "floating", "links"),
    [
        # A robot that drives about in front of a table, an arm and a door that lies about.
        (0, 5, {"robot", "a5", "a1", "table"}),
        (4, 2, {"b4", "b1", "table"}),
        (4, 4, {"b4", "b1", "table"}),
    ],
)
def test_what_floats_is_a_thing_unless_it_is_the_robot(tmp_path, standing, floating, links):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<mujoco><worldbody><body name="table"><geom size="0.3"/></body>'
        f'<body name="robot"><freejoint/><geom size="0.1"/>{nested("a", floating)}</body>'
        f"{nested('b', standing) if standing else ''}</worldbody></mujoco>"
    )
    names = {one.get("name") for one in read_mjcf(path).tree.findall("link")}
    assert links <= names
    assert ("robot" in names) == ("robot" in links)


def test_a_part_of_a_scene_is_told_as_such(tmp_path):
    part = tmp_path / "part.xml"
    part.write_text('<mujoco><body name="a"><joint/><geom size="0.1"/></body></mujoco>')
    with pytest.raises(RobotError, match=r"outside <worldbody>, .* expected the one that includes"):
        add_robot(part)
    whole = '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>'
    (tmp_path / "whole.xml").write_text(whole)
    assert len(read_mjcf(tmp_path / "whole.xml").tree.findall("link")) == 3


def test_nothing_is_overwritten_and_nothing_of_it_stays(tmp_path):
    path = write(tmp_path)
    (tmp_path / "bench.urdf").write_text("mine")
    with pytest.raises(RobotError, match=r"bench\.urdf: is there already"):
        add_robot(path)
    assert (tmp_path / "bench.urdf").read_text() == "mine"
    with pytest.raises(RobotError, match="tip: no link 'no'"):
        add_robot(path, "no", "other")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["bench.urdf", "bench.xml", "parts"]


def test_formats_are_told_by_their_first_element(tmp_path):
    assert is_mjcf(b"<?xml version='1.0'?><!-- robot --><mujoco/>")
    assert not is_mjcf(b"<robot name='mujoco'/>")
    compiled = read_mjcf(write(tmp_path))
    (follow,) = [one for one in compiled.tree.findall("joint") if one.find("mimic") is not None]
    assert follow.find("mimic").get("joint") == "grip"
