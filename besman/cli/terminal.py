"""What is printed. Names and labels come from files: they are shown, never obeyed."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from besman.exceptions import one_line

if TYPE_CHECKING:
    from rich.console import Console


def open_terminal(*, stderr: bool = False) -> Console:
    """Return a console for text of any origin.

    Square brackets are no markup and colons no emoji there, and what is not printable is written
    as in Python's source: an escape sequence in a label neither colours nor moves anything.

    Parameters
    ----------
    stderr : bool
        Print to the standard error in place of the standard output.
    """
    from rich.console import Console
    from rich.text import Text

    class Terminal(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            """Turn a string of any origin into what is shown; tables ask for their cells here."""
            return super().render_str(_shown(text), **options)

    return Terminal(markup=False, emoji=False, highlight=False, stderr=stderr)


def say(line: str) -> None:
    """Print a line at once, however long; a line break inside of it is shown, not made."""
    print(one_line(line), flush=True)  # noqa: T201


def complain(kind: str, text: str) -> None:
    """Print an error or a warning as one line to the standard error.

    Parameters
    ----------
    kind : str
        ``error`` or ``warning``; empty for a remark.
    text : str
        Whatever it quotes cannot start a line of its own.
    """
    print("besman:", *([f"{kind}:"] if kind else []), one_line(text), file=sys.stderr)  # noqa: T201


def _shown(text: str) -> str:
    """Write what is not printable as in Python's source; line breaks of our own tables stay."""
    return "\n".join(one_line(line) for line in text.split("\n"))
