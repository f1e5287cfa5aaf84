"""What the documentation says of the code is there, and its tables are those that were stored."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from importlib import import_module

import pytest
from places import TOP
from pydantic import BaseModel
from test_architecture import LAYERS

DOCS = TOP / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
NAME = re.compile(r"\bbesman(?:\.[A-Za-z_]\w*)+")


def extension(name: str):
    """Load one of the extensions of docs/."""
    pytest.importorskip("sphinx", reason="the extra docs is not installed")
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"extensions/{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def found(name: str) -> bool:
    """Say whether a dotted name can be imported, a part of a module included."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            thing = import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            if not hasattr(thing, part):
                return False
            thing = getattr(thing, part)
        return True
    return False


@pytest.mark.parametrize("page", [*PAGES, TOP / "README.md"], ids=lambda path: path.name)
def test_names_of_the_code_exist(page):
    text = re.sub(r"`{3}.*?`{3}", "", page.read_text(), flags=re.DOTALL)
    names = set(NAME.findall(text))
    assert [name for name in sorted(names) if not found(name)] == []


def test_the_method_names_every_stage():
    text = (DOCS / "method.md").read_text()
    assert len(NAME.findall(text)) > 50
    for stage in ("label", "segment", "recognize", "compose", "select", "map", "refine"):
        assert f"besman.stages.{stage}." in text
    for room in ("robot", "motion", "search", "classifiers", "transfer"):
        assert f"besman.{room}." in text
    assert not found("besman.stages.segment.vmci.no_such_function")


@pytest.mark.parametrize("page", [*PAGES, TOP / "README.md"], ids=lambda path: path.name)
def test_links_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_package_has_a_page():
    text = "".join(path.read_text() for path in (DOCS / "reference/api").glob("*.rst"))
    packages = {path.parent.name for path in (TOP / "besman").glob("*/__init__.py")}
    assert packages == set(re.findall(r"\.\. package:: besman\.(\w+)", text))


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_tables_of_the_program_are_shown_and_filled(page):
    shown = re.findall(r"`{3}{table-of} (\S+)\n(.*?)`{3}", page.read_text(), flags=re.DOTALL)
    if not shown:
        return
    table_of = extension("table_of")
    for name, content in shown:
        columns = table_of.columns_of(content.splitlines())
        assert all(title for _, title in columns)
        rows = table_of.rows_of(name, [attribute for attribute, _ in columns])
        assert len(rows) > 1
        assert all(len(row) == len(columns) and row[0] for row in rows)


def test_tables_of_the_thesis_are_shown_and_filled():
    tables = extension("thesis_tables")
    page = (DOCS / "thesis.md").read_text()
    shown = re.findall(r"{thesis-table} (.+)", page)
    content = tables.read_tables()
    assert shown == list(content)
    for number, table in content.items():
        titles, body = tables.cells(table)
        width = sum(len(below) for _, below in titles)
        assert all(len(values) == width for _, values in body), number
        for source in table["sources"]:
            assert tables.read_rows(source["file"]), f"{number}: {source['file']}"
        ours = [value for _, values in body for value in values[1:]]
        assert any(value != tables.MISSING for value in ours), number
    # A number of the thesis, one measured on real and one on simulated recordings.
    _, body = tables.cells(content["4.4"])
    assert dict(body)["vmci"][:3] == ["0.67", "0.68", "0.70"]


def test_two_rows_for_one_cell_are_an_error(tmp_path, monkeypatch):
    tables = extension("thesis_tables")
    rows = [{"method": "a", "f1": 1.0}, {"method": "a", "f1": 2.0}]
    (tmp_path / "two.json").write_text(json.dumps({"rows": rows}))
    monkeypatch.setattr(tables, "RESULTS", tmp_path)
    column = {"metric": "f1", "title": "F1"}
    row = {"name": "a", "select": {"method": "a"}}
    table = {"columns": [column], "sources": [{"title": "real", "file": "two.json"}], "rows": [row]}
    with pytest.raises(Exception, match=r"two.json: 2 rows fit \{'method': 'a'\}"):
        tables.cells(table)


def test_real_and_simulated_results_are_kept_apart():
    for path in (DOCS / "results").glob("*_*.json"):
        sources = {row.get("source") for row in json.loads(path.read_text()).get("rows", [])}
        word = path.stem.rsplit("_", 1)[1]
        assert sources <= {word}, path.name


def test_every_result_has_its_command():
    text = (DOCS / "results/README.md").read_text()
    for path in (DOCS / "results").glob("*.json"):
        assert f"`{path.name}`" in text


def sections(config: type[BaseModel], seen: dict[str, type[BaseModel]]) -> dict:
    """Return a config and those in it by name."""
    inside = extension("configuration").sections_of
    if config.__qualname__ not in seen:
        seen[config.__qualname__] = config
        for field in config.model_fields.values():
            for below in inside(field):
                sections(below, seen)
    return seen


def test_every_pipeline_key_is_described():
    from besman.pipeline.config import PipelineConfig

    described = extension("configuration").described
    missing = [
        f"{name}.{key}"
        for name, config in sections(PipelineConfig, {}).items()
        for key, field in config.model_fields.items()
        if key != "method" and not described(config).get(field.alias or key)
    ]
    assert missing == []


def test_methods_are_named_as_in_a_pipeline():
    from besman.pipeline.config import PipelineConfig

    inside, method_of = (
        getattr(extension("configuration"), n) for n in ("sections_of", "method_of")
    )
    names = [method_of(config) for config in inside(PipelineConfig.model_fields["refine"])]
    from besman.search.kinds import SEARCH_NAMES

    assert names == list(SEARCH_NAMES)


def test_every_command_and_option_is_described():
    from typer.main import get_command

    from besman.cli.main import app

    line = extension("command_line")
    found_commands = dict(line.commands(get_command(app), "besman"))
    assert {"besman run", "besman template learn", "besman robots add"} <= set(found_commands)
    for name, command in found_commands.items():
        assert command.help, name
        for term, meaning in line.rows_of(command):
            assert meaning.strip(), f"{name} {term}"
    # The same on every machine.
    assert "cores" in dict(line.rows_of(found_commands["besman run"]))["--jobs N"]


def test_equations_become_mathml():
    from docutils import nodes

    convert = extension("mathml").convert
    text = convert(r"y'' = \frac{a}{b}", nodes.math(), block=True)
    assert text.count("\N{PRIME}") == 2
    assert "<mfrac>" in text
    assert "&" not in convert(
        r"\begin{align*} a &= b \\ c &= d \end{align*}", nodes.math(), block=True
    )
    assert convert(r"\nonsense{a}", nodes.math(), block=False) == ""


def test_the_picture_of_the_rooms_shows_what_is_imported_and_no_circle(tmp_path):
    rooms = extension("rooms")
    texts = {
        "__main__": "from besman.top import a",
        "top/a": "def f():\n    import besman.low.b\nfrom besman.middle.m import M",
        "middle/m": "if TYPE_CHECKING:\n    from besman import low\nimport numpy.low",
        "low/b": "from besman.low import c",
        "alone": "",
    }
    for name, text in texts.items():
        path = tmp_path / "besman" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    found = rooms.read_rooms(tmp_path / "besman")
    assert found == {"alone": set(), "low": set(), "middle": {"low"}, "top": {"low", "middle"}}
    assert rooms.floors_of(found) == [["alone", "low"], ["middle"], ["top"]]
    assert rooms.arrows_of(found) == [("middle", "low"), ("top", "middle")]
    with pytest.raises(ValueError, match="rooms import each other: one, two"):
        rooms.floors_of({"one": {"two"}, "two": {"one"}, "none": set()})


def test_the_picture_of_besman_has_every_room_and_its_arrows_go_down():
    rooms = extension("rooms")
    found = rooms.read_rooms(TOP / "besman")
    assert set(found) == {room for floor in LAYERS for room in floor}
    boxes = rooms.place_rooms(found)
    assert all(boxes[one][1] < boxes[other][1] for one in found for other in found[one])
    assert all(width / 2 <= x <= rooms.WIDTH - width / 2 for x, _, width in boxes.values())
    picture = rooms.draw_rooms(found)
    assert picture.count("<rect") == len(found)
    # Whoever is seen is seen along arrows: none too few were left out.
    seen = {
        one: {other for first, other in rooms.arrows_of(found) if first == one} for one in found
    }
    for floor in rooms.floors_of(found):
        for one in floor:
            seen[one] |= {far for near in seen[one] for far in seen[near]}
            assert found[one] <= seen[one]
