"""xacro: expanded as the package itself does, with its ways out closed."""

import importlib.util
import os
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from besman.exceptions import RobotError
from besman.robot.files import xacro_file
from besman.robot.files.xacro_file import is_xacro, parse_arguments, read_xacro
from besman.robot.files.xacro_process import RefusedError, check_expression
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot

has_xacro = pytest.mark.skipif(
    importlib.util.find_spec("xacro") is None, reason="xacro is not installed"
)

MACROS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="radius" value="${0.02**2 + 0.03}"/>
<xacro:macro name="hinge" params="name parent length axis:='0 1 0'">
<link name="${name}_link"><inertial><mass value="${2 * length}"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial><collision>
<origin xyz="0 0 ${length / 2}"/><geometry><mesh filename="../meshes/box.stl"/></geometry>
</collision></link><joint name="${name}" type="revolute"><parent link="${parent}"/>
<child link="${name}_link"/><origin xyz="0 0 ${length}"/><axis xyz="${axis}"/>
<limit lower="${-pi / 2}" upper="${pi / 2}" effort="50" velocity="3"/></joint></xacro:macro></robot>
"""
ARM = """<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="length" default="0.2"/><xacro:include filename="$(find my_arm)/urdf/macros.xacro"/>
<link name="base"/>
<xacro:hinge name="a" parent="base" length="$(arg length)" axis="0 0 1"/>
<xacro:hinge name="b" parent="a_link" length="$(arg length)"/>{}</robot>
"""


@pytest.fixture
def package(tmp_path):
    """Write a ROS package; return what writes its arm."""
    home = tmp_path / "ws" / "sources"
    (home / "urdf").mkdir(parents=True)
    (home / "meshes").mkdir()
    (home / "package.xml").write_text("<package><name>my_arm</name></package>")
    (home / "urdf" / "macros.xacro").write_text(MACROS)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0], [0, 0, 0.2]])
    rows = np.zeros(4, dtype=record)
    rows["corners"] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    (home / "meshes" / "box.stl").write_bytes(b"\0" * 80 + b"\4\0\0\0" + rows.tobytes())

    def write(more="", text=ARM):
        path = home / "urdf" / "arm.urdf.xacro"
        path.write_text(text.replace("{}", more))
        return path

    return write


@has_xacro
def test_an_arm_comes_in_with_its_meshes(package, tmp_path):
    path = add_robot(package(), folder=tmp_path / "out", arguments={"name": "mine"})
    content = yaml.safe_load(path.read_text())
    assert path.name == "mine.yaml"
    assert (tmp_path / "out" / "mine.urdf").is_file()
    assert "xacro argument length: '0.2', its default" in content["assumed"]
    robot = load_robot(path)
    np.testing.assert_allclose(robot.limits.position_max, np.pi / 2, atol=1e-7)
    assert set(robot.chain.capsule_links) >= {"a_link", "b_link"}
    assert not [one for one in content["assumed"] if "mesh" in one]


@has_xacro
def test_it_is_what_the_package_itself_makes_of_it(package, monkeypatch, tmp_path):
    import xacro
    from xacro import substitution_args

    path = package()
    monkeypatch.setattr(substitution_args, "_eval_find", lambda name: str(path.parents[1]))
    wanted = ElementTree.fromstring(
        xacro.process_file(str(path), mappings={"name": "x", "length": "0.3"}).toxml()
    )
    found = read_xacro(path, {"name": "x", "length": "0.3"}, {}).tree
    for kind in ("link", "joint"):
        for one, other in zip(found.findall(kind), wanted.findall(kind), strict=True):
            for mesh in (*one.iter("mesh"), *other.iter("mesh")):
                mesh.attrib.clear()
            plain = [ElementTree.canonicalize(ElementTree.tostring(it)) for it in (one, other)]
            assert plain[0] == plain[1]


@has_xacro
def test_an_argument_may_be_used_above_its_default(package):
    text = ARM.replace("<link name=", '<xacro:arg name="name" default="early"/><link name=')
    found = read_xacro(package(text=text), {}, {})
    assert found.tree.get("name") == "early"
    assert "xacro argument name: 'early', its default" in found.notes
    assert read_xacro(package(text=text), {"name": "x"}, {}).tree.get("name") == "x"


@has_xacro
def test_a_property_may_be_called_like_anything(package):
    names = ["type", "format", "_max", "f_max", "co_x", "vars"]
    text = "".join(
        f'<xacro:property name="{name}" value="0.5"/><material name="${{{name} ** {name}}}"/>'
        for name in names
    )
    tree = read_xacro(package(text), {"name": "x"}, {}).tree
    found = [float(one.get("name")) for one in tree.findall("material")]
    assert found == pytest.approx([0.5**0.5] * len(names))


@has_xacro
def test_tags_without_a_prefix_are_read_as_old_files_mean_them(package):
    text = ARM.replace("xacro:arg", "arg").replace("<xacro:include", "<include")
    text = text.replace("<link name=", '<property name="turn" value="0.5"/><link name=')
    old = read_xacro(package('<material name="${turn}"/>', text=text), {"name": "x"}, {}).tree
    new = read_xacro(package('<material name="0.5"/>'), {"name": "x"}, {}).tree
    assert ElementTree.tostring(old) == ElementTree.tostring(new)


@has_xacro
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"xacro needs the arguments name; give --arg name=VALUE; those with a default: len"),
        ({"nam": "x"}, r"--arg: no argument 'nam'; did you mean 'name'"),
    ],
)
def test_what_arguments_there_are_is_said(package, arguments, message):
    with pytest.raises(RobotError, match=message):
        read_xacro(package(), arguments, {})


@has_xacro
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('<xacro:include filename="$(find nowhere)/a.xacro"/>', "package 'nowhere': no folder"),
        ('<xacro:include filename="{outside}"/>', "not allowed: the file '.*outside.xacro', which"),
        ("<a v=\"${xacro.load_yaml('{outside}')}\"/>", "the file '.*outside.xacro', which is outs"),
        ('<a v="$(env HOME)"/>', "not allowed: the environment variable 'HOME'"),
        ('<a v="${[].__class__}"/>', "not allowed: the name '__class__'"),
        ('<a v="${(lambda: 1)()}"/>', "not allowed: Lambda"),
        ('<a v="$(eval [0][0].mro)"/>', "the name 'mro'"),
        (
            '<xacro:include filename="$(arg length).xacro"/>',
            "xacro: .*No such file .*; --arg may change length=0.2",
        ),
        ('<a v="${undefined}"/>', "xacro: name 'undefined' is not defined"),
        ("<xacro:hinge/>", r"xacro: Undefined parameters \[name,parent,length\]"),
    ],
)
def test_what_leads_outside_is_refused(package, tmp_path, more, message):
    outside = tmp_path / "outside.xacro"
    outside.write_text("<robot/>")
    path = package(more.replace("{outside}", str(outside)))
    with pytest.raises(RobotError, match=message):
        read_xacro(path, {"name": "x"}, {})
    assert not list(tmp_path.glob("out/*"))


@has_xacro
def test_macros_alone_are_no_robot(package):
    with pytest.raises(
        RobotError, match=r"no links, only macros \(hinge\); expected the file that"
    ):
        read_xacro(package().with_name("macros.xacro"), {}, {})


@has_xacro
def test_a_package_that_no_folder_is_called_by_is_the_one_with_its_files(package):
    path = package()
    (path.parents[1] / "package.xml").unlink()
    assert read_xacro(path, {"name": "x"}, {}).packages["my_arm"] == path.parents[1]


@has_xacro
def test_entities_are_refused(package):
    path = package(text='<!DOCTYPE robot [<!ENTITY a "b">]>' + ARM.replace("{}", ""))
    with pytest.raises(RobotError, match="document types, entities"):
        read_xacro(path, {"name": "x"}, {})


@pytest.mark.parametrize(
    "text",
    [
        "().__class__.__bases__",
        "(x for x in [1]).gi_frame.f_builtins",
        "[y.f_globals for y in [1]]",
        "(lambda: ().__class__)()",
        "python.vars(python.type(1))",
        "python.type(1).mro()",
        "'{0.__class__}'.format(1)",
        "9**9**9",
        "1 << (1 << 60)",
        "2**99",
        "(x := 3)",
        "1" * 3000,
    ],
)
def test_expressions_that_lead_out_of_xacro(text):
    with pytest.raises(RefusedError):
        check_expression(text)


@pytest.mark.parametrize(
    "text",
    ["radius**2 + 0.5 * pi", "-pi/2 if a == 'x' else b[0].c", "radians(90)", "xacro.load_yaml(f)",
     "python.sorted([3, 1])", "1 +"],
)  # fmt: skip
def test_expressions_that_descriptions_have(text):
    check_expression(text)


def test_a_guarded_process_neither_writes_nor_runs(tmp_path):
    # In a process of its own: nothing takes an audit hook off.
    import subprocess

    script = (
        "import sys, os, socket, subprocess\nfrom pathlib import Path\n"
        "from besman.robot.files.xacro_process import RefusedError, guard\n"
        f"inside, outside = Path({str(tmp_path)!r}), Path({str(tmp_path.parent)!r})\n"
        "(inside / 'a').write_text('x'); (outside / 'b').write_text('x')\n"
        "(inside / 'link').symlink_to(outside / 'b')\n"
        "sys.addaudithook(guard([inside]))\nopen(inside / 'a').read()\n"
        "for attempt in (lambda: open(outside / 'b'), lambda: open(inside / 'a', 'w'),\n"
        "                lambda: open(inside / 'link'), lambda: os.system('true'),\n"
        "                lambda: os.remove(inside / 'a'), lambda: socket.socket(),\n"
        "                lambda: subprocess.Popen(['true'])):\n"
        "    try:\n        attempt()\n    except RefusedError:\n        print('refused')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=dict(os.environ)
    )
    assert done.stdout.split() == ["refused"] * 7, done.stderr


def test_files_and_arguments_are_told(tmp_path):
    assert is_xacro(tmp_path / "a.xacro", b"<robot/>")
    assert is_xacro(tmp_path / "a.urdf", b"<robot><xacro:macro/></robot>")
    assert not is_xacro(tmp_path / "a.urdf", b"<robot/>")
    assert parse_arguments(["a=1", "b=x=y"]) == {"a": "1", "b": "x=y"}
    with pytest.raises(RobotError, match="--arg: got 'a', expected NAME=VALUE"):
        parse_arguments(["a"])


def test_without_the_package_it_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(xacro_file, "find_spec", lambda name: None)
    path = tmp_path / "a.xacro"
    path.write_text("<robot/>")
    with pytest.raises(RobotError, match=r"'xacro' is not installed; pip install 'besman\[xacro\]"):
        add_robot(path)


def test_a_urdf_takes_no_arguments(tmp_path):
    path = tmp_path / "a.urdf"
    path.write_text("<robot name='a'><link name='b'/></robot>")
    with pytest.raises(RobotError, match="--arg: a URDF takes no arguments"):
        add_robot(path, arguments={"x": "1"})
