"""The house: which room may look into which. Read from the imports, lazy and typing ones too."""

import ast
from itertools import chain

import pytest
from places import TOP
from sources import nodes

# Top down: a room imports from rooms below it, never from one beside or above it.
LAYERS = (
    {"cli"},
    {"annotate"},
    {"view", "evaluation", "standalone"},
    {"report", "transfer", "templates", "following", "planning"},
    {"pipeline"},
    {"stages"},
    {"simulation"},
    {"live", "motion", "pictures", "synthetic"},
    {"robot", "io", "person"},
    {"config"},
    {"work", "classifiers", "search", "geometry", "web"},
    {"records"},
    {"foreign"},
    {"exceptions"},
)
DEPTH = {room: depth for depth, rooms in enumerate(LAYERS) for room in rooms}
AT_THE_ROOT = {"__init__", "__main__", "exceptions"}
# The table of what a file may hold: a record's module is imported when such a file is loaded.
NAMES_WHAT_IS_ABOVE = {"besman.records.files"}


def find_modules(package):
    """Return the path of every module below a folder by its dotted name."""
    found = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def read_imports(path, name, modules):
    """Return the modules that one imports, wherever in it that is written."""
    package = name if path.stem == "__init__" else name.rpartition(".")[0]
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([node.module] if node.module else [])])
            whole = {f"{base}.{alias.name}" for alias in node.names}
            found |= whole & modules.keys() or {base}
    return (found & modules.keys()) - {name}


def read_names(path, name, modules):
    """Return the modules that stand in a text of one, from which they can be imported too."""
    texts = (node.value for node in nodes(path) if isinstance(node, ast.Constant))
    found = {text.partition(":")[0] for text in texts if isinstance(text, str)}
    return (found & modules.keys()) - {name}


def read_graph(package, read=read_imports):
    """Return what every module of a package imports, or names in a text."""
    modules = find_modules(package)
    return {name: read(path, name, modules) for name, path in modules.items()}


def room_of(name):
    return name.split(".")[1] if "." in name else "__init__"


def upward(graph):
    """Return imports from a room into one beside or above it."""
    pairs = ((name, other) for name, others in graph.items() for other in sorted(others))
    return [
        f"{name} -> {other}"
        for name, other in pairs
        if {room_of(name), room_of(other)} <= DEPTH.keys()
        and room_of(name) != room_of(other)
        and DEPTH[room_of(other)] <= DEPTH[room_of(name)]
    ]


def between_stages(graph):
    """Return imports from one stage into another."""
    stages = {name: name.split(".")[2] for name in graph if name.startswith("besman.stages.")}
    return [
        f"{name} -> {other}"
        for name, stage in stages.items()
        for other in sorted(graph[name])
        if stages.get(other, stage) != stage
    ]


def circles(graph):
    """Return groups of modules that import each other: those that never run out of imports."""
    left = {name: set(others) for name, others in graph.items()}
    for _ in range(2):
        while ends := {name for name, others in left.items() if not others & left.keys()}:
            left = {name: others for name, others in left.items() if name not in ends}
        # The same the other way round: what nobody in a circle imports is in none.
        turned = {name: {one for one in left if name in left[one]} for name in left}
        left = turned
    return sorted(left)


@pytest.fixture(scope="module")
def graph():
    return read_graph(TOP / "besman")


def test_no_room_imports_from_beside_or_above(graph):
    assert upward(graph) == []


def test_no_stage_imports_another(graph):
    assert between_stages(graph) == []


def test_modules_that_are_imported_by_their_name_stand_below_too():
    named = read_graph(TOP / "besman", read_names)
    assert {line.split(" -> ")[0] for line in upward(named)} == NAMES_WHAT_IS_ABOVE
    assert between_stages(named) == []


def test_no_stage_but_those_with_files_of_their_own_knows_a_path():
    stages = TOP / "besman" / "stages"
    known = {
        path.relative_to(stages).parts[0]
        for path in sorted(stages.rglob("*.py"))
        for node in nodes(path)
        if isinstance(node, ast.Import | ast.ImportFrom) and "pathlib" in ast.unparse(node)
    }
    assert known == {"read", "export", "recognize", "refine"}


def test_no_modules_import_each_other_in_a_circle(graph):
    assert circles(graph) == []


def test_every_folder_is_a_room_that_has_its_layer(graph):
    rooms = {room_of(name) for name in graph} - {"__init__", "__main__"}
    assert rooms == set(chain.from_iterable(LAYERS))


def test_the_root_holds_folders_and_three_modules():
    assert {path.stem for path in (TOP / "besman").glob("*.py")} == AT_THE_ROOT


def test_these_checks_see_what_they_look_for(tmp_path):
    texts = {
        "__init__": "",
        "robot/__init__": "",
        "robot/arm": "def f():\n    from besman.stages.map import stage",
        "stages/__init__": "",
        "stages/map/__init__": "",
        "stages/map/stage": "if TYPE_CHECKING:\n    from ..select.stage import Select",
        "stages/select/__init__": "",
        "stages/select/stage": "import besman.robot.arm",
        "records/__init__": "import besman.records.one",
        "records/one": "import numpy",
        "records/two": "KINDS = {'a': 'besman.robot.arm:Arm', 'b': 'besman.robot.leg'}",
    }
    for name, text in texts.items():
        path = tmp_path / "besman" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    graph = read_graph(tmp_path / "besman")
    assert upward(graph) == ["besman.robot.arm -> besman.stages.map.stage"]
    assert between_stages(graph) == ["besman.stages.map.stage -> besman.stages.select.stage"]
    named = read_graph(tmp_path / "besman", read_names)
    assert upward(named) == ["besman.records.two -> besman.robot.arm"]
    assert circles(graph) == [
        "besman.robot.arm",
        "besman.stages.map.stage",
        "besman.stages.select.stage",
    ]
