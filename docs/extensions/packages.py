"""Directive ``package``: every public module of a package, from its docstrings."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


def modules_of(package: str) -> list[str]:
    """Return the modules of a package and of those inside it, sorted."""
    path = import_module(package).__path__
    found = pkgutil.walk_packages(path, f"{package}.")
    return sorted(info.name for info in found if not info.ispkg)


class Package(SphinxDirective):
    """Document all modules of a package, or those that are named."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Write one section for each module."""
        modules = [line.strip() for line in self.content] or modules_of(self.arguments[0])
        lines: list[str] = []
        for name in modules:
            title = f"``{name}``"
            lines += [title, "-" * len(title), "", f".. automodule:: {name}", "   :members:", ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("package", Package)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
