"""Directive ``table-of``: a table of the program, such as that of formats, as a table of a page.

The argument is ``module:NAME`` of a sequence; each line of the content is an attribute of its
entries and the title of that column, ``about: what it is``. An attribute in backquotes is shown as
code.
"""

from __future__ import annotations

from collections.abc import Iterable
from pkgutil import resolve_name
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


def rows_of(name: str, attributes: list[str]) -> list[list[str]]:
    """Return the cells of every entry; several values in one cell are joined by commas."""

    def cell(entry: Any, attribute: str) -> str:
        value = getattr(entry, attribute.strip("`"))
        values = [str(one) for one in (value if isinstance(value, tuple | list) else (value,))]
        return ", ".join(f"`{one}`" if attribute.startswith("`") else one for one in values)

    return [[cell(one, each) for each in attributes] for one in resolve_name(name)]


def columns_of(content: Iterable[str]) -> list[tuple[str, str]]:
    """Return attribute and title of each column."""
    parts = [line.partition(":") for line in content if line.strip()]
    return [(attribute.strip(), title.strip()) for attribute, _, title in parts]


class TableOf(SphinxDirective):
    """Show a table of the program."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Write one line for each entry; cells are text of a page, with names in backquotes."""
        columns = columns_of(self.content)
        titles = [title for _, title in columns]
        rows = rows_of(self.arguments[0], [attribute for attribute, _ in columns])
        shown = nodes.table(classes=["colwidths-auto"])
        group = nodes.tgroup(cols=len(columns))
        shown += group
        for cells in zip(titles, *rows, strict=True):
            group += nodes.colspec(colwidth=max(len(cell) for cell in cells))
        head, body = nodes.thead(), nodes.tbody()
        group += [head, body]
        head += self._line(titles)
        for values in rows:
            body += self._line(values)
        return [shown]

    def _line(self, texts: list[str]) -> nodes.row:
        """Write one line of cells."""
        line = nodes.row()
        for text in texts:
            entry = nodes.entry()
            entry += self.parse_text_to_nodes(text) if text else nodes.paragraph()
            line += entry
        return line


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("table-of", TableOf)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
