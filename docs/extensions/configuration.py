"""Directive ``configuration``: the keys of a checked config, their values and what they mean."""

from __future__ import annotations

import inspect
import re
import types
from importlib import import_module
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from docutils import nodes
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.util.docutils import SphinxDirective

_ENTRY = re.compile(r"^(\w[\w, ]*?)(?: : (.+))?$")
_NAMES = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def described(config: type) -> dict[str, str]:
    """Return what the docstrings of a class, its bases and those it refers to say of each key."""
    found: dict[str, str] = {}
    for one in config.__mro__:
        if one in (BaseModel, object):
            break
        text = inspect.cleandoc(one.__dict__.get("__doc__") or "")
        for name, words in _attributes(text).items():
            found.setdefault(name, words)
        for module, name in re.findall(r"`(besman[\w.]+)\.([A-Z]\w+)`", text.split("\n\n")[0]):
            for key, words in described(getattr(import_module(module), name)).items():
                found.setdefault(key, words)
    return found


def _attributes(text: str) -> dict[str, str]:
    """Read the section Attributes of a docstring."""
    _, _, attributes = text.partition("Attributes\n----------\n")
    names: list[str] = []
    lines: dict[str, list[str]] = {}
    for line in attributes.splitlines():
        if re.match(r"^-+$", line.strip()):
            # The title of the next section was read as a name.
            for name in names:
                lines.pop(name, None)
            break
        entry = _ENTRY.match(line)
        if entry:
            names = [name.strip() for name in entry[1].split(",")]
            lines |= {name: [] for name in names}
        elif line.strip():
            for name in names:
                lines[name].append(line.strip())
    return {name: " ".join(words) for name, words in lines.items()}


def kind_of(annotation: Any, field: FieldInfo | None = None) -> str:
    """Say in words which values a type takes."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return kind_of(inner[0])
    if origin is Literal:
        return " or ".join(str(value) for value in inner)
    if origin in (Union, types.UnionType):
        # Several sections are one word.
        return " or ".join(dict.fromkeys(kind_of(one) for one in inner))
    if annotation is type(None):
        return "null"
    if origin in (tuple, list):
        if inner[-1] is Ellipsis or origin is list:
            return f"list of {kind_of(inner[0])}"
        return f"{len(inner)} of {kind_of(inner[0])}"
    if origin is dict:
        return "section of keys"
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return "section"
    return _NAMES.get(annotation, getattr(annotation, "__name__", str(annotation)))


def bounds_of(field: FieldInfo) -> str:
    """Say which bounds a key has."""
    words = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    return ", ".join(
        f"{text} {getattr(mark, name):g}"
        for name, text in words.items()
        for mark in field.metadata
        if getattr(mark, name, None) is not None
    )


def default_of(field: FieldInfo) -> str:
    """Say what a key is if it is not given."""
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return "required"
    if isinstance(value, BaseModel):
        return str(getattr(value, "method", ""))
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list):
        return "[" + ", ".join(str(one) for one in value) + "]"
    return str(value)


def sections_of(field: FieldInfo) -> list[type[BaseModel]]:
    """Return the configs that a key may hold."""

    def inside(annotation: Any) -> list[type[BaseModel]]:
        if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
            return [annotation]
        return [found for one in get_args(annotation) for found in inside(one)]

    return inside(field.annotation)


class Configuration(SphinxDirective):
    """Document a config, ``module:Name``, and the sections in it."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write one section for each section of the config."""
        module, name = self.arguments[0].split(":")
        config = getattr(import_module(module), name)
        top, below = self._table(config, ())
        return [top, *self._sections(below)]

    def _sections(self, found: list[tuple[tuple[str, ...], list[type[BaseModel]]]]) -> list[Any]:
        """Write sections for keys that hold configs, and for those in them."""
        written: list[Any] = []
        for path, configs in found:
            for config in configs:
                chosen = method_of(config) if len(configs) > 1 else ""
                title = ".".join(path) + (f": {{method: {chosen}}}" if chosen else "")
                section = nodes.section(ids=[_place(path, chosen)], names=[title])
                section += nodes.title("", "", nodes.literal(text=title))
                text = inspect.cleandoc(config.__doc__ or "").split("\n\n")[0]
                section += self.parse_text_to_nodes(" ".join(text.split()))
                table, below = self._table(config, path)
                section += table
                section += self._sections(below)
                written.append(section)
        return written

    def _table(
        self, config: type[BaseModel], path: tuple[str, ...]
    ) -> tuple[nodes.definition_list, list[tuple[tuple[str, ...], list[type[BaseModel]]]]]:
        """Write the keys of one config; return the sections that stand in it."""
        meanings = described(config)
        listed = nodes.definition_list()
        below = []
        for name, field in config.model_fields.items():
            key = field.alias or name
            if key == "method" and get_origin(field.annotation) is Literal:
                # The title of the section says it.
                continue
            if sections := sections_of(field):
                below.append(((*path, key), sections))
            facts = [kind_of(field.annotation), bounds_of(field)]
            default = default_of(field)
            facts.append("required" if default == "required" else f"default {default}")
            if not default:
                facts.pop()
            item = nodes.definition_list_item()
            item += nodes.term("", "", nodes.literal(text=key))
            fact = nodes.paragraph("", "", nodes.emphasis(text="; ".join(filter(None, facts))))
            item += nodes.definition("", fact)
            meaning = meanings.get(key, "")
            if meaning and meaning != "The stages.":
                item[-1] += self.parse_text_to_nodes(meaning)
            if sections:
                item[-1] += _links((*path, key), sections)
            listed += item
        return listed, below


def method_of(config: type[BaseModel]) -> str:
    """Return which method a section stands for."""
    field = config.model_fields.get("method")
    # Some have no default: what is allowed is one word.
    return "" if field is None else str(get_args(field.annotation)[0])


def _place(path: tuple[str, ...], method: str) -> str:
    """Return the anchor of a section."""
    return "-".join(("key", *path, *filter(None, [method]))).replace("_", "-")


def _links(path: tuple[str, ...], configs: list[type[BaseModel]]) -> nodes.paragraph:
    """Write links to the sections of a key."""
    links = nodes.paragraph(text="See ")
    for index, config in enumerate(configs):
        method = method_of(config) if len(configs) > 1 else ""
        links += nodes.Text(", " if index else "")
        place = _place(path, method)
        links += nodes.reference("", "", nodes.literal(text=method or ".".join(path)), refid=place)
    return links


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("configuration", Configuration)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
