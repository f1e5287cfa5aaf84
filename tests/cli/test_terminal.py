"""Names and labels come from files: they are shown, never obeyed."""

import ast
import json
import shutil
import warnings

import pytest
from command_line import besman
from places import SAMPLE, TOP
from rich.table import Table
from sources import nodes

from besman.cli import main as cli
from besman.cli.terminal import complain, open_terminal, say
from besman.exceptions import RecordingWarning

FOREIGN = [
    "[/]",
    "[red]stop[/red]",
    "[link=file:///x]y[/link]",
    ":smile:",
    "\x1b[31mred",
    "a\x07\x9b",
]


@pytest.mark.parametrize("text", FOREIGN)
def test_foreign_text_is_shown_as_it_is_written(capsys, text):
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    open_terminal().print(text, soft_wrap=True)
    table = Table(title=text)
    table.add_column(text)
    table.add_row(text)
    open_terminal().print(table)
    say(text)
    complain("error", text)
    out, err = capsys.readouterr()
    assert out.count(shown) == 5
    assert err == f"besman: error: {shown}\n"
    assert not set(out + err) & set("\x1b\x07\x9b")


def test_a_line_break_makes_no_second_message(capsys):
    complain("error", "subject\nbesman: error: all is well")
    say("subject\nall is well")
    out, err = capsys.readouterr()
    assert err == "besman: error: subject\\nbesman: error: all is well\n"
    assert out == "subject\\nall is well\n"


def test_a_warning_that_quotes_a_file_is_one_line(capsys, monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", cli._show_warning)
    warnings.warn("marker '\x1b[2J\nbesman: done'", RecordingWarning, stacklevel=1)
    assert capsys.readouterr().err == "besman: warning: marker '\\x1b[2J\\nbesman: done'\n"


def test_labels_that_look_like_markup_are_learnt_and_shown(tmp_path, monkeypatch, capsys):
    shutil.copy(SAMPLE / "subject1.tsv", tmp_path)
    name = "subject1_manually_segmented.json"
    content = json.loads((SAMPLE / name).read_text())
    text = json.dumps(content).replace('"throw"', '"[/] [red]throw"')
    (tmp_path / name).write_text(text)
    assert besman(monkeypatch, "train", tmp_path, "--out", tmp_path / "m") == 0
    assert "[/] [red]throw " in capsys.readouterr().out


def test_only_one_module_opens_a_console():
    users = []
    texts = {path: path.read_text(encoding="utf-8") for path in (TOP / "besman").rglob("*.py")}
    for path in (path for path, text in texts.items() if "Console" in text or "echo" in text):
        for node in nodes(path):
            names = [one.name for one in getattr(node, "names", []) if isinstance(one, ast.alias)]
            if isinstance(node, ast.ImportFrom) and node.module == "rich.console":
                users += [path.name] if "Console" in names else []
            called = node.func if isinstance(node, ast.Call) else None
            if isinstance(called, ast.Attribute) and called.attr == "echo":
                users.append(path.name)
    # The report's functions take a console; they only name its type.
    assert set(users) <= {"terminal.py"}
