"""JSON from anywhere: nesting, digits and words that no JSON has end in one kind of error."""

from __future__ import annotations

import json
from itertools import chain
from typing import Any, NoReturn

DEEPEST = 64
"""Levels of lists and objects in each other; what besman writes has fewer than ten."""

MOST_DIGITS = 19
"""Digits of an integer: those of 64 bits."""

_NODES = frozenset((dict, list))


def parse_json(text: str | bytes, allow_nan: bool = False) -> Any:
    """Parse JSON.

    Parameters
    ----------
    text : str or bytes
        UTF-8 if bytes.
    allow_nan : bool
        Take ``NaN``, as Python writes what is missing; ``Infinity`` becomes NaN, too.

    Returns
    -------
    dict, list, str, int, float, bool or None

    Raises
    ------
    json.JSONDecodeError
        A `ValueError`: if it is no JSON, nested deeper than `DEEPEST`, or has an integer of more
        than `MOST_DIGITS` digits, ``NaN`` or ``Infinity``. ``msg`` and ``lineno`` say what and
        where, the latter as 1 where it is not known.
    """
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8")
        except UnicodeDecodeError:
            raise json.JSONDecodeError("expected text in UTF-8", "", 0) from None
    try:
        content = json.loads(
            text, parse_int=_parse_int, parse_constant=_take_nan if allow_nan else _refuse
        )
    except json.JSONDecodeError:
        raise
    except RecursionError:
        _refuse_depth()
    except ValueError as error:
        raise json.JSONDecodeError(str(error), "", 0) from None
    # Text that opens fewer brackets cannot be deeper.
    if text.count("[") + text.count("{") > DEEPEST and is_deep(content, DEEPEST):
        _refuse_depth()
    return content


def is_deep(content: Any, deepest: int) -> bool:
    """Tell whether lists and objects of JSON lie in each other more than so many levels."""
    level = [content] if type(content) in _NODES else []
    for _ in range(deepest):
        inside = chain.from_iterable(
            [node.values() if type(node) is dict else node for node in level]
        )
        # Exactly these: most of what is looked at are numbers.
        level = [node for node in inside if type(node) in _NODES]
        if not level:
            return False
    return True


def _parse_int(digits: str) -> int:
    """Parse an integer that 64 bits hold."""
    if len(digits.lstrip("-")) > MOST_DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits; expected at most {MOST_DIGITS}")
    return int(digits)


def _refuse(word: str) -> NoReturn:
    """Refuse what Python writes for numbers that are none."""
    raise ValueError(f"{word} is no JSON")


def _take_nan(word: str) -> float:
    return float("nan")


def _refuse_depth() -> NoReturn:
    raise json.JSONDecodeError(
        f"lists and objects lie in each other more than {DEEPEST} levels deep", "", 0
    )
