"""Docstrings as they are written here: footnotes by number, references to besman that must hold."""

from __future__ import annotations

import re
from typing import Any

from sphinx.util import logging

logger = logging.getLogger(__name__)

_CITED = re.compile(r"\[(\d+)\]_")
_FOOTNOTE = re.compile(r"^\s*\.\. \[(\d+)\] ")


def number_footnotes(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Write footnotes as a list: every docstring counts from 1, and a page has many."""
    for index, line in enumerate(lines):
        found = _FOOTNOTE.match(line)
        if found:
            # As wide as the mark was, so that the lines below stay in place.
            indent = line[: len(line) - len(line.lstrip())]
            line = f"{indent}*  [{found[1]}] {line[found.end() :]}"
        lines[index] = _CITED.sub(r"[\1]", line)


def check_reference(app: Any, env: Any, node: Any, contents: Any) -> None:
    """Warn of a reference to something of besman that is not there."""
    target = node.get("reftarget", "")
    if re.fullmatch(r"besman(\.\w+)+", target) and not _exists(target):
        logger.warning("no such module, class or function: %s", target, location=node)


def _exists(target: str) -> bool:
    """Say whether a dotted name can be found by importing."""
    from importlib import import_module

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
    app.connect("missing-reference", check_reference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
