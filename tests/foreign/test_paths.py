from pathlib import Path

import pytest

from besman.foreign.paths import file_alike, is_file, is_folder


def test_files_and_folders_are_told_apart(tmp_path):
    file = tmp_path / "a"
    file.write_text("")
    assert [is_file(file), is_folder(file)] == [True, False]
    assert [is_file(tmp_path), is_folder(tmp_path)] == [False, True]
    assert [is_file(file / "b"), is_folder(tmp_path / "b")] == [False, False]


@pytest.mark.parametrize("text", ["a\0b", "a" * 5000, "/".join("a" * 9000)])
def test_a_text_that_no_path_can_be_is_neither(text):
    assert not is_file(Path(text))
    assert not is_folder(Path(text))


def test_a_file_that_differs_in_capitals_is_found_unless_there_are_two_or_it_leads_elsewhere(
    tmp_path,
):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "Link1.STL").write_text("")
    wanted = tmp_path / "a" / "link1.stl"
    assert file_alike(wanted) == tmp_path / "a" / "Link1.STL"
    assert file_alike(tmp_path / "b" / "link1.stl") is None
    (tmp_path / "a" / "LINK1.stl").write_text("")
    assert file_alike(wanted) is None
    (tmp_path / "away.stl").write_text("")
    (tmp_path / "a" / "Away.stl").symlink_to(tmp_path / "away.stl")
    assert file_alike(tmp_path / "a" / "away.stl") is None
