"""Every module is imported by a test, or it is said here which test looks at it, and how.

The tests mirror the tree: what is in a folder is tested in the folder of the same name.
"""

import ast

from places import TESTS, TOP
from sources import tree
from test_architecture import find_modules

# Commands are run by what a user types: the tests of what they start, and tests/command_line.py.
COMMANDS = "besman.cli."
# Looked at without an import: how, and by which test.
OTHERWISE = {
    "besman.__main__": ("python -m besman", "annotate/test_commands.py"),
    "besman.annotate.proposals": ("through a session", "annotate/test_proposals.py"),
    "besman.following.json_events": ("in what is printed", "following/test_live.py"),
    "besman.io.recordings.keypoint_frames": (
        "through its reader",
        "io/recordings/test_keypoint_layouts.py",
    ),
    "besman.pipeline.compile_kernels": ("compiled by `make install`, counted in CI", "../.ci/run"),
    "besman.pipeline.run_record": ("through a run", "pipeline/test_run_folder.py"),
    "besman.report.page_style": ("in the browser", "report/test_page.py"),
    "besman.search.contextual": ("a protocol of its searches", "search/test_contextual.py"),
    "besman.search.load_cma": ("in a process of its own", "search/test_load_cma.py"),
    "besman.search.protocol": ("a protocol of its searches", "search/test_gaussian_searches.py"),
    "besman.simulation.tasks.grasp_box.grasp_box": ("by its kind", "contracts/test_tasks.py"),
    "besman.simulation.tasks.grasp_box.sections": ("by its kind", "contracts/test_tasks.py"),
    "besman.simulation.tasks.pull_lever.pull_lever": ("by its kind", "contracts/test_tasks.py"),
    "besman.simulation.tasks.pull_lever.sections": ("by its kind", "contracts/test_tasks.py"),
    "besman.stages.map.map_demonstrations": (
        "through its stage",
        "stages/map/test_map_demonstrations.py",
    ),
    "besman.stages.recognize.figures": ("through its stage", "stages/recognize/test_figures.py"),
    "besman.view.assets": ("served to the page", "view/test_page.py"),
    "besman.web.connections": ("through a server", "web/test_loopback.py"),
    "besman.work.cluster": ("through workers", "work/test_cluster.py"),
    "besman.work.display": ("the type of a callable", "pipeline/test_run_folder.py"),
}


# What every entry of a table keeps to, and mutants of all that is foreign.
OF_MANY = {"contracts", "fuzz"}


def read_imports(path):
    """Return the names that a file imports: modules, and what may be a module of a package."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def handed_on(name, path):
    """Return where the names come from that a package hands on, by their names in it."""
    return {
        f"{name}.{alias.name}": node.module
        for node in tree(path).body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


def untested(package, tests):
    """Return the modules with code that no test imports, not even by the name of their package."""
    modules = find_modules(package)
    code = {name: path for name, path in modules.items() if path.stem != "__init__"}
    seen = set().union(*(read_imports(path) for path in tests.rglob("*.py")))
    for name, path in modules.items():
        if path.stem == "__init__":
            seen |= {source for alias, source in handed_on(name, path).items() if alias in seen}
    return {name for name in code if name not in seen and not name.startswith(COMMANDS)}


def not_mirrored(package, tests):
    """Return folders that one tree has and the other lacks, and tests far from their module."""
    modules = {path for path in package.rglob("*.py") if path.stem != "__init__"}
    places = {path.relative_to(package).parent.as_posix() for path in modules}
    found, tested = [], set()
    for path in sorted(tests.rglob("test_*.py")):
        place, name = path.relative_to(tests).parent.as_posix(), path.stem.removeprefix("test_")
        if place in OF_MANY | {"."}:
            continue
        tested.add(place)
        homes = {one.relative_to(package).parent.as_posix() for one in modules if one.stem == name}
        wanted = {".".join([package.name, *home.split("/"), name]) for home in homes}
        if place not in homes and wanted & read_imports(path):
            found.append(f"{place}/{path.name}: its module is elsewhere")
    return found + sorted(tested ^ (places - {"."}))


def test_the_tests_mirror_the_tree():
    assert not_mirrored(TOP / "besman", TESTS) == []


def test_a_test_looks_at_every_module():
    assert sorted(untested(TOP / "besman", TESTS)) == sorted(OTHERWISE)


def test_the_tests_that_look_at_them_otherwise_are_there():
    missing = [name for _, name in OTHERWISE.values() if not (TESTS / name).is_file()]
    assert missing == []


def test_this_check_sees_what_it_looks_for(tmp_path):
    texts = {
        "besman/__init__": "",
        "besman/records/__init__": "from besman.records.one import One",
        "besman/records/one": "One = 1",
        "besman/records/two": "Two = 2",
        "besman/arm": "",
        "besman/leg": "",
        "besman/cli/main": "",
        "tests/test_all": "from besman.records import One\nfrom besman import arm",
    }
    for name, text in texts.items():
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    found = untested(tmp_path / "besman", tmp_path / "tests")
    assert found == {"besman.records.two", "besman.leg"}


def test_a_test_that_is_not_where_its_module_is_is_seen(tmp_path):
    texts = {
        "besman/__main__": "",
        "besman/robot/arm": "",
        "besman/robot/leg": "",
        "besman/person/hand": "",
        "besman/web/page": "",
        "tests/robot/test_arm": "from besman.robot.arm import Arm",
        "tests/robot/test_hand": "from besman.person.hand import Hand",
        "tests/person/test_leg": "from besman.person import hand",
        "tests/limbs/test_all": "",
        "tests/fuzz/test_arm": "import besman.robot.arm",
        "tests/test_arm": "import besman.robot.arm",
    }
    for name, text in texts.items():
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert not_mirrored(tmp_path / "besman", tmp_path / "tests") == [
        "robot/test_hand.py: its module is elsewhere",
        "limbs",
        "web",
    ]
