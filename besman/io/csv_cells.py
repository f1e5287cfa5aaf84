"""Text in CSV files: programs that open tables compute what begins like a formula."""

from __future__ import annotations

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_QUOTE = "'"


def quote_text(text: str) -> str:
    """Return a text as a cell that no spreadsheet program takes for a formula.

    Parameters
    ----------
    text : str
        A name, never a number.

    Returns
    -------
    str
        With an apostrophe before it if it begins like a formula, or with an apostrophe.
    """
    return f"{_QUOTE}{text}" if text.startswith((*_FORMULA, _QUOTE)) else text


def unquote_text(cell: str) -> str:
    """Undo `quote_text`; a cell from which a program took the apostrophe stays as it is."""
    return cell[1:] if cell.startswith(_QUOTE) else cell
