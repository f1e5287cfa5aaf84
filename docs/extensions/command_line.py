"""Directive ``command-line``: every command with its arguments and options, from the program."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


def commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Give a command and those below it, in the order of the help text."""
    if not getattr(command, "hidden", False):
        yield name, command
        for key, below in getattr(command, "commands", {}).items():
            yield from commands(below, f"{name} {key}")


def _sort(parameter: Any) -> str:
    """Say what a parameter takes."""
    if parameter.param_type_name == "argument":
        return parameter.name.upper() + (" ..." if parameter.nargs == -1 else "")
    names = ", ".join(parameter.opts)
    if parameter.is_flag:
        return names
    annotation = str(parameter.type_descriptor.annotation)
    kinds = {"int": "N", "float": "NUMBER", "Path": "PATH"}
    kind = next((kinds[name] for name in kinds if name in annotation), "TEXT")
    return f"{names} {kind}" + (" ..." if parameter.multiple else "")


def _meaning(parameter: Any) -> str:
    """Say what a parameter means, with its default."""
    text = parameter.help or ""
    default = parameter.default
    if parameter.name == "jobs":
        # The default is the number of cores, which differs from machine to machine.
        assert default == (os.cpu_count() or 1)
        return f"{text} Default: as many as there are cores."
    if parameter.required:
        return f"{text} Required." if parameter.param_type_name == "option" else text
    shown = default not in (None, False) and not callable(default) and default != ()
    return f"{text} Default: {default}." if shown else text


def rows_of(command: Any) -> list[tuple[str, str]]:
    """Return what a command takes and what it means."""
    return [
        (_sort(one), _meaning(one))
        for one in command.params
        if not getattr(one, "hidden", False) and one.name != "help"
    ]


class CommandLine(SphinxDirective):
    """Document a command line program made with typer."""

    def run(self) -> list[nodes.Node]:
        """Write one section for each command."""
        from typer.main import get_command

        from besman.cli.main import app

        found: list[nodes.Node] = []
        for name, command in commands(get_command(app), "besman"):
            section = nodes.section(ids=[name.replace(" ", "-")], names=[name])
            section += nodes.title("", "", nodes.literal(text=name))
            text = " ".join((command.help or "").split())
            section += nodes.paragraph(text=text)
            if rows := rows_of(command):
                section += _definitions(rows)
            found.append(section)
        return found


def _definitions(rows: list[tuple[str, str]]) -> nodes.definition_list:
    """Write rows as a list of terms and their meanings: it stays readable on a narrow page."""
    listed = nodes.definition_list()
    for term, meaning in rows:
        item = nodes.definition_list_item()
        item += nodes.term("", "", nodes.literal(text=term))
        item += nodes.definition("", nodes.paragraph(text=meaning))
        listed += item
    return listed


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
