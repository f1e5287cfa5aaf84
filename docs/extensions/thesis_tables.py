"""Directive ``thesis-table``: a table of the thesis with ours beside it, from stored JSON files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml
from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

RESULTS = Path(__file__).resolve().parents[1] / "results"
MISSING = "\N{EN DASH}"

Row = dict[str, Any]


def read_tables() -> dict[str, Any]:
    """Return the tables by their number."""
    found: dict[str, Any] = yaml.safe_load((RESULTS / "thesis.yaml").read_text(encoding="utf-8"))
    return found


def read_rows(file: str) -> list[Row]:
    """Return the rows of a file that a command wrote; ``synth``: what the program can simulate."""
    if file == "synth":
        from besman.synthetic.datasets import DATASETS

        return [
            {
                "dataset": name,
                "subjects": len(one.repetitions),
                "movements": sum(one.repetitions) * max(1, len(one.planners)),
            }
            for name, one in DATASETS.items()
        ]
    path = RESULTS / file
    if not path.is_file():
        return []
    content = json.loads(path.read_text(encoding="utf-8"))
    rows: list[Row] = content["rows"] if "rows" in content else content["stages"]
    return rows


def pick(rows: list[Row], wanted: Row) -> list[Row]:
    """Return the rows with these values; a list of values allows each of them."""

    def fits(row: Row) -> bool:
        return all(
            row.get(key) in value if isinstance(value, list) else row.get(key) == value
            for key, value in wanted.items()
        )

    return [row for row in rows if fits(row)]


def look_up(row: Row, path: str) -> Any:
    """Return a value of a row; ``borders`` are those found and those missed."""
    if path == "borders":
        return row["tp"] + row["fn"]
    value: Any = row
    for key in path.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    return value


def written(value: Any, column: Row, *, raw: bool = False) -> str:
    """Write a value; `raw` ones are in the column's unit already."""
    if value is None:
        return MISSING
    if isinstance(value, str) or (raw and isinstance(value, int)):
        return str(value)
    if not raw:
        value = value * (100 if column.get("percent") else column.get("scale", 1))
    return f"{value:.{column.get('digits', 0)}f}"


def cells(table: Row) -> tuple[list[tuple[str, list[str]]], list[tuple[str, list[str]]]]:
    """Return titles with the sources below them, and rows with their cells.

    Raises
    ------
    ExtensionError
        If several rows of a file fit where one is meant.
    """
    sources = table["sources"]
    found = {source["file"]: read_rows(source["file"]) for source in sources}
    titles = [
        (one["title"], ["thesis", *(s["title"] for s in sources)]) for one in table["columns"]
    ]
    body = []
    for row in table["rows"]:
        values = []
        matches = []
        for source in sources:
            wanted = {**source.get("where", {}), **row.get("select", {})}
            fitting = pick(found[source["file"]], wanted) if "select" in row else []
            if len(fitting) > 1 and not isinstance(row["select"].get("name"), list):
                raise ExtensionError(f"{source['file']}: {len(fitting)} rows fit {wanted}")
            matches.append(fitting)
        for column in table["columns"]:
            path = column["metric"].format(label=row.get("label", ""))
            key = "segments" if "{label}" in column["metric"] else column["metric"]
            values.append(written(row.get("thesis", {}).get(key), column, raw=True))
            for fitting in matches:
                ours = [look_up(one, path) for one in fitting]
                known = [one for one in ours if one is not None]
                values.append(written(sum(known) if known else None, column))
        body.append((row["name"], values))
    return titles, body


class ThesisTable(SphinxDirective):
    """Show a table of the thesis with ours beside."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Write the table with two lines of titles."""
        number = self.arguments[0]
        self.env.note_dependency(str(RESULTS / "thesis.yaml"))
        table = read_tables()[number]
        for source in table["sources"]:
            self.env.note_dependency(str(RESULTS / source["file"]))
        titles, body = cells(table)
        n_columns = 1 + sum(len(below) for _, below in titles)
        shown = nodes.table(classes=["thesis"])
        word = "Section" if table.get("section") else "Table"
        shown += nodes.title(text=f"{word} {number}: {table['title']}")
        group = nodes.tgroup(cols=n_columns)
        shown += group
        group += [nodes.colspec(colwidth=1) for _ in range(n_columns)]
        head = nodes.thead()
        upper, lower = nodes.row(), nodes.row()
        upper += _entry("", morerows=1)
        for title, below in titles:
            upper += _entry(title, morecols=len(below) - 1, classes=["group"])
            for source in below:
                lower += _entry(source, classes=["number", source])
        head += [upper, lower]
        group += head
        lines = nodes.tbody()
        for name, values in body:
            line = nodes.row()
            line += _entry(name)
            names = ["thesis", *(source["title"] for source in table["sources"])]
            for index, value in enumerate(values):
                line += _entry(value, classes=["number", names[index % len(names)]])
            lines += line
        group += lines
        return [shown]


def _entry(text: str, **attributes: Any) -> nodes.entry:
    entry = nodes.entry(**attributes)
    entry += nodes.paragraph(text=text)
    return entry


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("thesis-table", ThesisTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
