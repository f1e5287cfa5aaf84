from pathlib import Path

import pytest

from besman.foreign.paths import is_file, is_folder


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
