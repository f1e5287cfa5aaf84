"""What a field of a record may hold, by its annotation: held against what a file says."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Hashable
from functools import cache
from typing import Any, Literal, Union, cast

import numpy as np

from besman.foreign.names import LONGEST_TEXT, fault_of_characters

# Kinds of numbers in a file that an array may be made of.
_KINDS = {"f": "fiu", "i": "iu", "b": "b"}
_PLAIN: dict[Any, tuple[type, ...]] = {str: (str,), int: (int,), float: (float, int), bool: (bool,)}
# Sentences that say why something failed, in lines of a library's choice.
_SENTENCES = ("reason", "failure")


def check_fields(kind: type[Any], values: dict[str, Any]) -> None:
    """Hold the values of a record's fields against its annotations.

    Parameters
    ----------
    kind : type
        A dataclass.
    values : dict
        By the names of its fields.

    Raises
    ------
    ValueError
        If a field is missing, unknown, or of another type.
    """
    known = {field.name: field for field in dataclasses.fields(kind)}
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise ValueError(f"{kind.__name__} has no field {unknown[0]!r:.60}")
    # A class is hashable, whatever mypy takes its instances' `__hash__` for.
    annotated = hints(cast(Hashable, kind))
    for name, field in known.items():
        if name in values:
            _check(values[name], annotated[name], f"{kind.__name__}.{name}")
        elif field.default is field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{kind.__name__}.{name} is missing")


@cache
def hints(kind: type[Any]) -> dict[str, Any]:
    """Return the types of a dataclass' fields."""
    return typing.get_type_hints(kind)


def _check(value: Any, hint: Any, where: str) -> None:
    """Refuse a value that is not of a type."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        _check_texts_in(value, where)
        return
    if origin in (Union, types.UnionType):
        _check_union(value, inner, where)
    elif origin is Literal:
        if value not in inner or type(value) is not type(inner[0]):
            raise ValueError(f"{where}: got {value!r:.60}, expected one of {inner}")
    elif origin is tuple:
        _check_tuple(value, inner, where)
    elif origin is dict:
        if type(value) is not dict:
            raise ValueError(f"{where}: got {_kind(value)}, expected a dict")
        for key, one in value.items():
            _check(key, inner[0], where)
            _check(one, inner[1], f"{where}[{key!r:.40}]")
    elif origin is np.ndarray:
        _check_array(value, np.dtype(typing.get_args(inner[1])[0]), where)
    elif type(value) not in _PLAIN.get(hint, (hint,)):
        raise ValueError(f"{where}: got {_kind(value)}, expected {_name(hint)}")
    elif hint is str and not where.endswith(_SENTENCES):
        fault = fault_of_characters(value)
        if len(value) > LONGEST_TEXT:
            fault = f"has {len(value)} characters, more than {LONGEST_TEXT}"
        if fault is not None:
            raise ValueError(f"{where}: {value!r:.60} {fault}")


def _check_texts_in(value: Any, where: str) -> None:
    """Refuse texts of which the annotation says nothing, but a terminal would obey."""
    if isinstance(value, str):
        _check(value, str, where)
    elif isinstance(value, dict | tuple):
        for item in value.items() if isinstance(value, dict) else value:
            _check_texts_in(item, where)


def _check_union(value: Any, options: tuple[Any, ...], where: str) -> None:
    """Refuse a value that is of none of several types."""
    for option in options:
        try:
            return _check(value, option, where)
        except ValueError:
            continue
    raise ValueError(f"{where}: got {_kind(value)}, expected {' or '.join(map(_name, options))}")


def _check_tuple(value: Any, inner: tuple[Any, ...], where: str) -> None:
    """Refuse what is no tuple of a type, or of several types in their order."""
    if type(value) is not tuple:
        raise ValueError(f"{where}: got {_kind(value)}, expected a tuple")
    if inner[-1] is Ellipsis:
        inner = (inner[0],) * len(value)
    if len(value) != len(inner):
        raise ValueError(f"{where}: got {len(value)} entries, expected {len(inner)}")
    for index, (one, hint) in enumerate(zip(value, inner, strict=True)):
        _check(one, hint, f"{where}[{index}]")


def _check_array(value: Any, dtype: np.dtype[Any], where: str) -> None:
    """Refuse what is no array of numbers of a kind."""
    if not isinstance(value, np.ndarray):
        raise ValueError(f"{where}: got {_kind(value)}, expected an array")
    if value.dtype.kind not in _KINDS[dtype.kind] or value.dtype == np.uint64:
        raise ValueError(f"{where}: got an array of {value.dtype}, expected {dtype}")
    if value.dtype.kind == "f" and np.isinf(value).any():
        raise ValueError(f"{where}: got an array with infinite numbers")


def _name(hint: Any) -> str:
    return "None" if hint is type(None) else getattr(hint, "__name__", str(hint))


def _kind(value: Any) -> str:
    return f"{type(value).__name__} {value!r:.40}"
