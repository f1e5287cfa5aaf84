"""Tables as HTML text."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

_TAGS = re.compile(r"<[^>]*>")
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")


def html_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    sortable: bool = False,
    words: bool = False,
) -> str:
    """Make a table.

    Parameters
    ----------
    header : sequence of str
        HTML.
    rows : sequence of sequence of str
        HTML of the cells. A cell is sorted by the number that it starts with, else by its text.
    sortable : bool
        Whether a click on a head sorts; see `besman.report.page_style.SORT_SCRIPT`.
    words : bool
        Whether the cells hold sentences, which are set from the left and broken.

    Returns
    -------
    str
        In a box that scrolls where the table is wider.
    """
    order = ' aria-sort="none"' if sortable else ""
    head = "".join(f'<th scope="col"{order}>{name}</th>' for name in header)
    body = "".join(
        "<tr>" + "".join(_cell(cell, sortable) for cell in row) + "</tr>" for row in rows
    )
    kind = "sortable" if sortable else "words" if words else "figures"
    table = f'<table class="{kind}">'
    table += f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="scroll">{table}</div>'


def _cell(content: str, sortable: bool) -> str:
    if not sortable:
        return f"<td>{content}</td>"
    return f'<td data-sort="{html.escape(sort_key(content))}">{content}</td>'


def sort_key(content: str) -> str:
    """Return what a cell is sorted by: a number, else its text; "" without a value."""
    text = html.unescape(_TAGS.sub("", content)).strip()
    number = _NUMBER.match(text)
    # A name may start with a number; a quantity is followed by nothing, a unit, or "of".
    if number and (number.end() == len(text) or text[number.end()] in " /%"):
        return number.group()
    return "" if text == "-" else text
