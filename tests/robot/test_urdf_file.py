import pytest

from besman.exceptions import RobotError
from besman.robot.files.mesh_folders import mesh_path
from besman.robot.urdf_file import read_urdf

LINKS = "".join(f"<link name='{name}'/>" for name in "abc")


def joint(name, parent, child):
    ends = f"<parent link='{parent}'/><child link='{child}'/>"
    return f"<joint name='{name}' type='fixed'>{ends}</joint>"


def read(folder, text):
    (folder / "arm.urdf").write_bytes(text.encode("utf-8") if isinstance(text, str) else text)
    return read_urdf(folder / "arm.urdf", folder)


def robot(*joints):
    return f"<robot name='arm'>{LINKS}{''.join(joints)}</robot>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (robot(joint("j", "a", "b"), joint("k", "b", "c"), joint("l", "c", "b")),
         "loop: link 'b' hangs on 'a' and, by joint l, on 'c'"),
        (robot(joint("j", "a", "b"), joint("k", "b", "a")), "loop: link 'a' hangs on itself"),
        (robot(joint("j", "a", "b")), "one link that hangs on nothing, got a, c"),
        (robot(joint("j", "a", "d")), "joint j: no link 'd'"),
        ("<!DOCTYPE r [<!ENTITY b '" + "c" * 9 + "'>]><robot/>", "entities are not allowed"),
        ("<robot", "not valid XML"),
        ("<robot/>", "expected <robot> with links$"),
        ("<sdf version='1.7'><model/></sdf>", "expected <robot> with links, got <sdf>$"),
        ("<mujocoinclude/>", "a part of a MJCF; give the file that includes it$"),
        (b"\xff\xfe<\x00", "expected text in UTF-8"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_be_used(tmp_path, text, message):
    with pytest.raises(RobotError, match=message):
        read(tmp_path, text)


def test_a_mesh_is_scaled_by_the_unit_of_its_file(tmp_path):
    units = {"inch": '<unit name="inch" meter="0.0254"/>', "none": "", "odd": '<unit meter="x"/>'}
    for name, unit in units.items():
        (tmp_path / f"{name}.dae").write_text(f"<COLLADA><asset>{unit}</asset></COLLADA>")
    shape = "<collision><geometry><mesh filename='{}.dae' {}/></geometry></collision>"
    meshes = [("inch", ""), ("inch", "scale='2 2 -2'"), ("none", ""), ("odd", "scale='2 2 2'")]
    shapes = "".join(shape.format(*one) for one in meshes)
    tree = read(tmp_path, f"<robot><link name='a'>{shapes}</link></robot>")
    scales = [one.get("scale") for one in tree.iter("mesh")]
    assert scales == ["0.0254 0.0254 0.0254", "0.0508 0.0508 -0.0508", None, "2 2 2"]
    # And a robot without a name is called by its file.
    assert tree.get("name") == "arm"


def test_shapes_of_no_width_are_none(tmp_path):
    words = ('<sphere radius="0.00"/>', '<cylinder radius="0" length="1"/>',
             '<capsule radius="0" length="1"/>', '<sphere radius="0.01"/>')  # fmt: skip
    shapes = "".join(f"<collision><geometry>{one}</geometry></collision>" for one in words)
    tree = read(tmp_path, f"<robot><link name='a'>{shapes}</link></robot>")
    assert [one.get("radius") for one in tree.iter("sphere")] == ["0.01"]
    assert len(tree.findall("link/collision")) == 1


@pytest.mark.parametrize(
    "address", ["../../etc/passwd", "/etc/passwd", "file:///etc/passwd", "package://../x.stl"]
)
def test_a_mesh_outside_the_folder(tmp_path, address):
    shape = f"<collision><geometry><mesh filename='{address}'/></geometry></collision>"
    mesh = f"<link name='d'>{shape}</link>"
    joints = [joint("j", "a", "b"), joint("k", "b", "c"), joint("l", "c", "d")]
    with pytest.raises(RobotError, match=r"mesh .* is outside"):
        read(tmp_path, f"<robot name='arm'>{LINKS}{mesh}{''.join(joints)}</robot>")


def test_addresses_of_meshes(tmp_path):
    home = tmp_path.resolve()
    urdf = home / "urdf" / "arm.urdf"
    assert mesh_path("package://arm/a.stl", urdf, home) == home / "arm" / "a.stl"
    assert mesh_path("../meshes/a.stl", urdf, home) == home / "meshes" / "a.stl"
    assert mesh_path(f"package://{home.name}/a.stl", urdf, home) == home / "a.stl"
