"""Where ``package://`` leads."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from besman.exceptions import RobotError
from besman.robot.files.mesh_folders import (
    MeshFolders,
    find_mesh_folders,
    find_package,
    list_faults,
    parse_packages,
    places_tried,
)


def tree_of(*addresses):
    shapes = "".join(
        f"<link><collision><geometry><mesh filename='{one}'/></geometry></collision></link>"
        for one in addresses
    )
    return ElementTree.fromstring(f"<robot>{shapes}</robot>")


def make(folder, *parts, package=None):
    place = folder.joinpath(*parts)
    place.mkdir(parents=True, exist_ok=True)
    if package is not None:
        (place / "package.xml").write_text(f"<package><name> {package} </name></package>")
    return place


@pytest.mark.parametrize(
    ("folders", "expected"),
    [
        ([("ws", "arm", "urdf")], ("ws", "arm")),
        ([("ws", "other", "urdf"), ("ws", "arm")], ("ws", "arm")),
        ([("ws", "checkout", "urdf")], ("ws", "checkout")),
        ([("ws", "x", "urdf"), ("ws", "y")], ("ws", "y")),
    ],
)
def test_a_package_is_above_beside_or_says_its_name(tmp_path, folders, expected):
    for folder in folders:
        make(tmp_path, *folder)
    make(tmp_path, *expected, package="arm" if expected[-1] in ("checkout", "y") else None)
    urdf = tmp_path.joinpath(*folders[0], "a.urdf").resolve()
    assert find_package("arm", list(urdf.parents)[:5]) == tmp_path.resolve().joinpath(*expected)
    for odd in ("", "..", ".", "a\x00b", "none_such"):
        assert find_package(odd, [tmp_path / "ws"]) is None or odd == ""


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_a_package_of_a_workspace(tmp_path, monkeypatch, variable):
    parts = ("share", "arm") if variable.startswith("AMENT") else ("arm",)
    found = make(tmp_path, "elsewhere", *parts)
    monkeypatch.setenv(variable, f"{tmp_path / 'none'}:{tmp_path / 'elsewhere'}")
    above = [make(tmp_path, "here", "urdf")]
    assert find_package("arm", above) == found


def test_what_is_given_comes_first_and_files_tell_in_the_end(tmp_path):
    urdf = make(tmp_path, "arm_description", "urdf") / "a.urdf"
    (make(tmp_path, "arm_description", "meshes") / "a.stl").write_text("")
    given = {"other": make(tmp_path, "mine")}
    tree = tree_of("package://other/x.stl", "package://arm_support/meshes/a.stl", "m.stl")
    folders = find_mesh_folders(tree, urdf, given)
    assert folders.packages == {
        "other": (tmp_path / "mine").resolve(),
        "arm_support": (tmp_path / "arm_description").resolve(),
    }
    (guess,) = folders.guessed
    assert guess.startswith("arm_support is taken for the folder ")
    # What lies beside a folder "urdf" is the arm's, what lies above that is not.
    assert folders.home == (tmp_path / "arm_description").resolve()
    assert find_mesh_folders(tree, urdf, given, tmp_path).home == tmp_path.resolve()
    assert find_mesh_folders(tree, tmp_path / "a.urdf", {}).home == tmp_path.resolve()


def test_every_place_that_was_tried_is_named(tmp_path):
    urdf = tmp_path / "a.urdf"
    folders = MeshFolders(tmp_path, {"known": tmp_path})
    said = places_tried("package://arm/x.stl", urdf, folders)
    for part in ("called arm above", "package.xml", "ROS_PACKAGE_PATH", "--package arm=FOLDER"):
        assert part in said
    assert places_tried("package://known/x.stl", urdf, folders) == f"no file {tmp_path / 'x.stl'}"
    assert "is outside" in places_tried("../../x.stl", urdf, folders)


def test_packages_of_the_command_line(tmp_path):
    assert parse_packages([f"a={tmp_path}"]) == {"a": tmp_path}
    for wrong in ("a", f"={tmp_path}", f"a={tmp_path / 'none'}"):
        with pytest.raises(RobotError, match=r"--package: got .*expected NAME=FOLDER"):
            parse_packages([wrong])
    assert parse_packages([]) == dict[str, Path]()


def test_meshes_of_a_package_with_one_reason_are_one_line():
    gone = "no such file: no folder called arm above /a"
    faults = {f"package://arm/m/{name}.stl": f"mesh /a/arm/m/{name}.stl: {gone}" for name in "cab"}
    faults["package://arm/m/big.stl"] = "mesh /a/arm/m/big.stl: 120 MB, more than 100"
    faults["../x.stl"] = "mesh '../x.stl' is outside /a; expected it below that folder"
    faults["../y.stl"] = "mesh '../y.stl' is outside /a; expected it below that folder"
    assert list_faults(faults) == [
        "2 meshes, the first '../x.stl' is outside /a; expected it below that folder",
        f"3 meshes of package arm, the first /a/arm/m/a.stl: {gone}",
        "mesh /a/arm/m/big.stl: 120 MB, more than 100",
    ]
