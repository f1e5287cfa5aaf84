import subprocess
from importlib import metadata
from pathlib import Path

import numpy
import pytest

import besman
from besman.work import versions


def test_libraries_have_their_versions_and_one_that_is_missing_says_so(monkeypatch):
    found = versions.library_versions()
    assert found["numpy"] == numpy.__version__
    assert found["besman"] == besman.__version__

    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(versions.metadata, "version", missing)
    # What was asked before is kept.
    monkeypatch.setattr(versions, "_version", versions._version.__wrapped__)
    assert versions.library_versions()["numpy"] == "not installed"


def test_the_code_is_told_apart_by_every_byte_and_name(monkeypatch, tmp_path):
    (tmp_path / "besman").mkdir()
    (tmp_path / "besman" / "__init__.py").write_text("a = 1\n")
    monkeypatch.setattr(besman, "__file__", str(tmp_path / "besman" / "__init__.py"))
    # A process asks once.
    code_version = versions.code_version.__wrapped__
    seen = {code_version()}
    (tmp_path / "besman" / "one.py").write_text("")
    seen.add(code_version())
    (tmp_path / "besman" / "one.py").rename(tmp_path / "besman" / "two.py")
    seen.add(code_version())
    (tmp_path / "besman" / "two.py").write_text("b = 2\n")
    seen.add(code_version())
    assert len(seen) == 4
    assert versions.commit.__wrapped__() == "installed"


@pytest.mark.skipif(
    not (Path(besman.__file__).parents[1] / ".git").exists(), reason="this is no checkout"
)
def test_the_commit_is_that_of_the_checkout():
    command = ["git", "-C", str(Path(besman.__file__).parent), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert head.startswith(versions.commit.__wrapped__().removesuffix("-dirty").rpartition("-g")[2])
