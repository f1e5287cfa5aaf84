"""Docstrings as they are written here: types are words, names in backquotes are of besman or plain.

A name in backquotes becomes a link if the module at hand, or besman, has it; a name of besman that
nothing has is a warning.
"""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.util import logging
from sphinx.util.docutils import SphinxRole

logger = logging.getLogger(__name__)

_CITED = re.compile(r"\[(\d+)\]_")
_FOOTNOTE = re.compile(r"^(\s*)\.\. \[(\d+)\] ")
_FIELD = re.compile(r"^:(param|ivar) ([^:]+):(.*)$")
_TYPE = re.compile(r"^:(?:type|vartype) ([^:]+): (.*)$")


def number_footnotes(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Write footnotes as a list: every docstring counts from 1, and a page has many."""
    for index, line in enumerate(lines):
        if found := _FOOTNOTE.match(line):
            # As wide as the mark was, so that the lines below stay in place.
            line = f"{found[1]}*  [{found[2]}] {line[found.end() :]}"
        lines[index] = _CITED.sub(r"[\1]", line)


def write_types(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Put types before what is said of a parameter or attribute.

    Left to Sphinx, words in types and names of attributes would become links to anything.
    """
    types = {found[1]: found[2] for line in lines if (found := _TYPE.match(line))}
    kept: list[str] = []
    attributes = False
    hanging = ""
    for line in lines:
        if _TYPE.match(line):
            continue
        if found := _FIELD.match(line):
            kind = types.get(found[2], "").replace("*", r"\*")
            text = f"*{kind}*.{found[3]}" if kind else found[3].strip()
            hanging = ""
            if found[1] == "ivar":
                kept += [] if attributes else [":Attributes:", ""]
                attributes = True
                line, hanging = f"    * **{found[2]}** \N{EN DASH} {text}", "      "
            else:
                line = f":{found[1]} {found[2]}: {text}"
        elif hanging and line.strip():
            if line[0] != " ":
                hanging = ""
            else:
                line = hanging + line.strip()
        kept.append(line)
    lines[:] = kept


def skip_foreign(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out methods that another package puts into a class."""
    module = getattr(obj, "__module__", None) or ""
    return True if module.startswith(("sklearn", "pydantic")) else None


class Name(SphinxRole):
    """A name in backquotes."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Refer to it where it is found: in the class, in the module, or by its full name."""
        context = self.env.ref_context
        module, inside = context.get("py:module") or "", context.get("py:class") or ""
        text = nodes.literal(text=self.text, classes=["xref", "py"])
        for target in (f"{module}.{inside}.{self.text}", f"{module}.{self.text}", self.text):
            if re.fullmatch(r"besman(\.\w+)+", target) and exists(target):
                break
        else:
            if re.fullmatch(r"besman(\.\w+)+", self.text):
                logger.warning("nothing is named %s", self.text, location=self.get_location())
            return [nodes.literal(text=self.text)], []
        node = addnodes.pending_xref(
            "", text, refdomain="py", reftype="obj", reftarget=target, refexplicit=False
        )
        return [node], []


def exists(target: str) -> bool:
    """Say whether a dotted name can be found by importing."""
    parts = target.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found: Any = import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            fields = getattr(found, "__dataclass_fields__", {}) | getattr(found, "model_fields", {})
            if not hasattr(found, part) and part not in fields:
                return False
            found = getattr(found, part, None)
        return True
    return False


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("autodoc-process-docstring", number_footnotes, priority=400)
    app.connect("autodoc-process-docstring", write_types, priority=600)
    app.connect("autodoc-skip-member", skip_foreign)
    app.add_role("name", Name())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
