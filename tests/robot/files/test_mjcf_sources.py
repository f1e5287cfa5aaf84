"""Files of a MJCF: those that MuJoCo would read, in whatever way they are named."""

import pytest

from besman.exceptions import RobotError
from besman.robot.files.mjcf_sources import refuse_files_outside


@pytest.fixture
def scene(tmp_path):
    """Write files below a folder; return the first."""

    def write(**texts):
        for name, text in texts.items():
            path = tmp_path / "home" / name.replace("__", "/")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.with_suffix(".xml").write_text(f"<mujoco>{text}</mujoco>")
        return tmp_path / "home" / f"{next(iter(texts))}.xml"

    return write


def test_what_is_included_is_looked_at_and_named(scene):
    path = scene(a='<include file="parts/b.xml"/>', parts__b='<include file="c.xml"/>', parts__c="")
    assert [one.name for one in refuse_files_outside(path)] == ["b.xml", "c.xml"]
    inside = path.parent / "parts" / "c.xml"
    inside.write_text('<mujoco><asset><mesh file="/elsewhere/x.stl"/></asset></mujoco>')
    with pytest.raises(RobotError, match=r"'/elsewhere/x\.stl' is outside"):
        refuse_files_outside(path)


def test_of_places_that_a_name_may_mean_one_is_enough(scene, tmp_path):
    # Beside the file that is read first this would lead outside, beside the one that says so not.
    path = scene(a='<include file="parts/b.xml"/>',
                 parts__b='<asset><mesh file="../meshes/x.stl"/></asset>')  # fmt: skip
    assert len(refuse_files_outside(path)) == 1
    # What is there, where MuJoCo may look for it, counts.
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "x.stl").write_text("")
    with pytest.raises(RobotError, match=r"meshes/x\.stl' is outside .*--package NAME=FOLDER"):
        refuse_files_outside(path)
    assert len(refuse_files_outside(path, [tmp_path / "meshes"])) == 1


def test_a_folder_that_any_file_names_is_meant_in_all(scene):
    path = scene(a='<include file="b.xml"/><asset><mesh file="x.stl"/></asset>',
                 b='<compiler meshdir="/elsewhere"/>')  # fmt: skip
    with pytest.raises(RobotError, match=r"'/elsewhere/x\.stl' is outside"):
        refuse_files_outside(path)


def test_pictures_and_files_in_a_row_without_end_are_no_trouble(scene):
    path = scene(a='<include file="a.xml"/><asset><texture file="/wood.png"/></asset>')
    assert refuse_files_outside(path) == []
