"""What a target of the Makefile runs finds what it imports, and says what went wrong if not."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

TOP = Path(__file__).parents[1]
# Which target runs the code of which folder; tests import the documentation's extensions and run
# the examples.
TARGETS = {
    "tests": ("test",),
    "docs": ("docs", "test"),
    "examples": ("docs", "test"),
    "benchmarks": ("bench",),
}
# Of one release with pin: coal; with pydantic: its core.
DISTRIBUTIONS = {
    "dfols": "dfo-ls",
    "OpenGL": "pyopengl",
    "PIL": "pillow",
    "coal": "pin",
    "mcap_ros2": "mcap-ros2-support",
    "mpl_toolkits": "matplotlib",
    "pinocchio": "pin",
    "pydantic_core": "pydantic",
    "pydrake": "drake",
    "sklearn": "scikit-learn",
    "yaml": "pyyaml",
}
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
FOR_USERS = ("cluster", "lerobot", "lsl", "lstm", "mirror", "optitrack", "qualisys")
FOR_USERS += ("ros", "sequences", "transfer", "verify", "video", "xacro")

# It removes what the others make; and Drake is too large to be fetched every time.
NOT_IN_CI = ("clean-venv", "test-verify")

needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")


def declared(extras) -> set[str]:
    """Return the distributions of `dependencies` and of extras, the extras that those name too."""
    names, queue = set(), [*PROJECT["dependencies"], *(one for e in extras for one in EXTRAS[e])]
    for text in queue:
        requirement = Requirement(text)
        if requirement.name == "besman":
            queue += [one for extra in requirement.extras for one in EXTRAS[extra]]
        else:
            names.add(canonicalize_name(requirement.name))
    return names


def run_make(*arguments, **settings) -> subprocess.CompletedProcess[str]:
    """Call make in the checkout, as from a terminal: not as a part of the make that tests."""
    named = [f"{name}={value}" for name, value in settings.items()]
    own = {
        name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFL"))
    }
    return subprocess.run(
        ["make", *arguments, *named], cwd=TOP, text=True, capture_output=True, env=own
    )


@cache
def imports(source: str) -> tuple[set[str], set[str]]:
    """Return the top-level names that code imports, and those that it can do without.

    It can do without an import whose failure it catches, and without what `importorskip` names.
    """
    found = list(ast.walk(ast.parse(source)))
    spared = {
        id(node)
        for attempt in found
        if isinstance(attempt, ast.Try)
        and any("ImportError" in ast.unparse(h.type or ast.Name("")) for h in attempt.handlers)
        for statement in attempt.body
        for node in ast.walk(statement)
    }
    needed, optional = set(), set()
    for node in found:
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module]
        elif isinstance(node, ast.Call) and (
            getattr(node.func, "attr", "") == "importorskip"
            and ast.unparse(node.func) == "pytest.importorskip"
        ):
            spared.add(id(node))
            names = [one.value for one in node.args[:1] if isinstance(one, ast.Constant)]
        (optional if id(node) in spared else needed).update(name.split(".")[0] for name in names)
    return needed, optional


@cache
def third_party(folder: str) -> tuple[dict[str, Path], dict[str, Path]]:
    """Return the distributions that a folder's code needs, and can do without, with a file each."""
    files = [path for path in (TOP / folder).rglob("*.py") if "_build" not in path.parts]
    own = {path.stem for place in TARGETS for path in (TOP / place).rglob("*.py")}
    own |= {path.name for path in (TOP / "tests").iterdir() if path.is_dir()}
    needed, optional = {}, {}
    for path in files:
        for names, found in zip(imports(path.read_text()), (needed, optional), strict=True):
            for name in names - own - set(sys.stdlib_module_names) - {"besman"}:
                found[canonicalize_name(DISTRIBUTIONS.get(name, name))] = path.relative_to(TOP)
    return needed, optional


def test_imports_are_found_and_those_that_may_fail_told_apart():
    source = """
import a.b
def f():
    from c import d
    pytest.importorskip("e.f")
    try:
        import g
    except (ImportError, OSError):
        import h
    try:
        import i
    except ValueError:
        from . import j
"""
    assert imports(source) == ({"a", "c", "h", "i"}, {"e", "g"})


def test_types_of_what_an_extra_brings_are_not_looked_at():
    """``make lint`` installs none of it: mypy says the same wherever it is called."""
    settings = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["mypy"]["overrides"]
    skipped = {
        name.removesuffix(".*")
        for one in settings
        if one.get("follow_imports") == "skip"
        for name in one["module"]
    }
    of_extras = declared(FOR_USERS) - declared(())
    found: set[str] = set()
    for path in (TOP / "besman").rglob("*.py"):
        found |= set.union(*imports(path.read_text()))
    optional = {n for n in found if canonicalize_name(DISTRIBUTIONS.get(n, n)) in of_extras}
    assert optional == skipped, "[[tool.mypy.overrides]] of pyproject.toml"


@needs_make
@pytest.mark.parametrize(
    ("folder", "target"), [(folder, target) for folder in TARGETS for target in TARGETS[folder]]
)
def test_a_target_installs_what_its_code_imports(folder, target, tmp_path):
    # Without a venv nothing is compiled: what only a compiler brings is not counted on.
    said = run_make("--dry-run", target, VENV=tmp_path / "venv").stdout
    extras = re.findall(r'--editable "\.(?:\[([\w,]+)\])?"', said)
    assert len(extras) == 1
    installed = declared(extras[0].split(","))
    needed, optional = third_party(folder)
    assert len(needed) > 1
    missing = {name: str(path) for name, path in needed.items() if name not in installed}
    assert missing == {}, f"not in what make {target} installs"
    unknown = {name: str(path) for name, path in optional.items() if name not in declared(EXTRAS)}
    assert unknown == {}, "in no extra"


def test_what_besman_imports_is_declared():
    needed, optional = third_party("besman")
    allowed = declared(FOR_USERS)
    files = {**needed, **optional}
    assert {name: str(path) for name, path in files.items() if name not in allowed} == {}
    # Files without a module, and what joblib's loky imports.
    assert declared(()) - set(files) == {"example-robot-data", "psutil"}, "not imported"


def test_all_that_is_installed_is_pinned():
    lines = (TOP / "constraints.txt").read_text().split()
    pins = dict(line.split("==") for line in lines)
    assert len(pins) == len(lines)
    pinned = {canonicalize_name(name) for name in pins}
    seen, queue = set(), [("besman", ("test", *EXTRAS["test"]))]
    while queue:
        name, extras = queue.pop()
        try:
            requirements = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            # An extra that was not asked for, or is skipped on this machine.
            continue
        for text in requirements:
            requirement = Requirement(text)
            marker = requirement.marker
            if marker and not any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
                continue
            key = (canonicalize_name(requirement.name), tuple(sorted(requirement.extras)))
            if key not in seen:
                seen.add(key)
                queue.append(key)
    names = {name for name, _ in seen} - {"besman"}
    assert len(names) > 60
    assert sorted(names - pinned) == []


def test_ci_makes_every_target_alone_and_the_tests_first():
    makefile, ci = (TOP / "Makefile").read_text(), (TOP / ".ci/run").read_text()
    (targets,) = re.findall(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    alone = re.findall(r"^alone (\S+)", ci, re.MULTILINE)
    assert alone[0] == "test"
    assert re.search(r"^alone install$(.*\n){1,3}make .* run$", ci, re.MULTILINE)
    assert sorted([*alone, "run", *NOT_IN_CI]) == sorted(targets.split())


@pytest.fixture
def venv(tmp_path):
    """Make a folder like a venv's whose Python is a script of our own."""

    def make_venv(script):
        program = tmp_path / "venv/bin/python"
        program.parent.mkdir(parents=True)
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        for tool in ("ruff", "mypy"):
            shutil.copy(program, program.parent / tool)
        return tmp_path / "venv"

    return make_venv


@needs_make
def test_what_pip_says_is_in_a_log(venv):
    folder = venv('case "$*" in *pip*) echo WARNING; echo told >&2;; esac')
    done = run_make("lint", VENV=folder)
    assert done.returncode == 0
    assert done.stdout.splitlines()[0] == (
        f"installing 95 packages (1.6 GB) into {folder}: about a minute; log: {folder}/install.log"
    )
    assert "WARNING" not in done.stdout + done.stderr
    assert (folder / "install.log").read_text() == "WARNING\ntold\n"
    again = run_make("lint", VENV=folder)
    assert "installing" not in again.stdout


@needs_make
@pytest.mark.parametrize(("setting", "lazily"), [("", True), ("1", False)])
def test_bytecode_is_written_at_once_where_it_would_never_be(setting, lazily, venv, monkeypatch):
    folder = venv(f'exec {sys.executable} "$@"')
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", setting)
    assert ("--no-compile" in run_make("--dry-run", "lint", VENV=folder).stdout) == lazily


@needs_make
def test_a_failure_of_pip_names_the_log(venv):
    folder = venv('case "$*" in *pip*) seq 40; exit 1;; esac')
    done = run_make("lint", VENV=folder)
    assert done.returncode == 2
    last = [str(number) for number in range(26, 41)]
    said = f"pip failed: all that it said is in {folder}/install.log"
    assert done.stdout.splitlines()[1:] == [*last, said]
    assert len((folder / "install.log").read_text().splitlines()) == 40
    assert not (folder / ".lint").exists()


@needs_make
def test_a_machine_without_openmp_gets_that_of_scikit_learn(venv):
    folder = venv('case "$*" in *libgomp*) exit 1;; esac')
    site = folder / "lib/python3.14/site-packages"
    (site / "cmeel.prefix/lib").mkdir(parents=True)
    (site / "scikit_learn.libs").mkdir()
    (site / "scikit_learn.libs/libgomp-e985bcbb.so.1.0.0").write_text("OpenMP")
    assert run_make("lint", VENV=folder).returncode == 0
    assert (site / "cmeel.prefix/lib/libgomp.so.1").read_text() == "OpenMP"


@needs_make
@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("exit 1", "besman needs Python 3.11 or newer; say which with: make PYTHON=python3.12"),
        (
            'test "$1" = -c',
            "no venv module: install python3-venv, or say make PYTHON=...",
        ),
    ],
)
def test_a_python_that_cannot_be_used(script, message, tmp_path):
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    done = run_make("install", VENV=tmp_path / "venv", PYTHON=program)
    assert done.returncode == 2
    assert done.stdout.splitlines() == [message]


def conflicts(text: str) -> list[int]:
    """Return the numbers of lines at which git left a conflict open."""
    return [n for n, line in enumerate(text.splitlines(), 1) if re.match(r"([<>|])\1{6} ", line)]


def test_no_file_has_an_open_conflict():
    if not (TOP / ".git").exists():
        pytest.skip("not a checkout of git: which files are tracked is not known")
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=TOP, capture_output=True, check=True, text=True
    )
    files = [TOP / name for name in listed.stdout.split("\0") if name]
    assert len(files) > 100
    found = {}
    for path in files:
        if path.is_file() and b"\0" not in (content := path.read_bytes()):
            lines = conflicts(content.decode(errors="replace"))
            found |= {str(path.relative_to(TOP)): lines} if lines else {}
    assert found == {}


def test_an_open_conflict_is_seen():
    left = "\n".join(["a", "<" * 7 + " HEAD", "b", "=" * 7, "c", ">" * 7 + " main", "<<< d"])
    assert conflicts(left) == [2, 6]
