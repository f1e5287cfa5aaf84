"""Read YAML into checked configs; errors name file, line, what was got and what is allowed."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError

from besman.exceptions import ConfigError, nearest
from besman.foreign.yaml_text import YamlTextError, parse_yaml

ConfigType = TypeVar("ConfigType", bound=BaseModel)
KeyPath = tuple[str | int, ...]

_TAG_ERRORS = {"union_tag_invalid", "union_tag_not_found"}


def read_yaml(path: Path) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """Read a YAML mapping with the safe loader.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    content : dict
        What the file says.
    lines : dict
        Line number (from 1) of every key, by its path of keys.

    Raises
    ------
    ConfigError
        If the file is missing, not YAML, not a mapping, or has a key twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read as text: {error}") from None
    lines: dict[KeyPath, int] = {}
    try:
        content, node = parse_yaml(text)
    except YamlTextError as error:
        where = f"{path}:{error.line}" if error.line else f"{path}"
        raise ConfigError(f"{where}: not valid YAML: {error}") from None
    if node is not None:
        _collect_lines(node, (), lines, path)
    if not isinstance(content, dict):
        raise ConfigError(f"{path}:1: expected a mapping of keys to values, got {content!r:.60}")
    return content, lines


def _collect_lines(node: yaml.Node, at: KeyPath, lines: dict[KeyPath, int], path: Path) -> None:
    """Note the line of every key below `node`; refuse a key that is there twice."""
    if isinstance(node, yaml.MappingNode):
        for key_node, value_node in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if (*at, key) in lines:
                raise ConfigError(
                    f"{path}:{line}: key {key!r} is there twice, first in line {lines[(*at, key)]}"
                )
            lines[(*at, key)] = line
            _collect_lines(value_node, (*at, key), lines, path)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            lines[(*at, index)] = item.start_mark.line + 1
            _collect_lines(item, (*at, index), lines, path)


def parse_config(
    content: dict[str, Any],
    model: type[ConfigType],
    path: Path | str,
    lines: dict[KeyPath, int] | None = None,
    settings: Iterable[str] = (),
) -> ConfigType:
    """Check a mapping against a config model.

    Parameters
    ----------
    content : dict
        What was read.
    model : type
        The pydantic model to make.
    path : Path or str
        Named in errors.
    lines : dict, optional
        Line of every key, from `read_yaml`.
    settings : iterable of str
        Dotted keys that were set over what the file says; errors in them name these.

    Returns
    -------
    BaseModel
        An instance of `model`.

    Raises
    ------
    ConfigError
        With one line for the first error: file, line, key, got, allowed.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        # An unknown key is usually a misspelt one, so it explains the "missing" beside it.
        details = sorted(error.errors(), key=lambda detail: detail["type"] != "extra_forbidden")
        above = [tuple(key.split(".")) for key in settings]
        raise ConfigError(_explain(details[0], model, path, lines or {}, above)) from None


def load_config(path: Path, model: type[ConfigType]) -> ConfigType:
    """Read a YAML file into a config model; see `read_yaml` and `parse_config`."""
    content, lines = read_yaml(path)
    return parse_config(content, model, path, lines)


def _explain(
    detail: Any,
    model: type[BaseModel],
    path: Path | str,
    lines: dict[KeyPath, int],
    settings: list[tuple[str, ...]],
) -> str:
    """Put one pydantic error into one line of plain words."""
    location: KeyPath = tuple(detail["loc"])
    at = _key_path(location, model, lines, settings)
    if detail["type"] in _TAG_ERRORS:
        at = (*at, "method")
    line = next((lines[at[:end]] for end in range(len(at), 0, -1) if at[:end] in lines), None)
    where = f"{path}:{line}" if line else f"{path}"
    key = ".".join(str(part) for part in at) or "the file"
    for setting in settings:
        if at[: len(setting)] == setting:
            where = f"--set {'.'.join(setting)}"
    place = where if where == f"--set {key}" else f"{where}: {key}"
    if detail["type"] == "extra_forbidden":
        allowed = _fields(_follow(model, location[:-1]))
        return f"{where}: unknown key {key!r}; {nearest(str(at[-1]), allowed)}"
    if detail["type"] == "missing":
        return f"{where}: key {key!r} is missing"
    if detail["type"] in _TAG_ERRORS:
        tags = [tag.strip(" '") for tag in str(detail["ctx"].get("expected_tags", "")).split(",")]
        tag = detail["ctx"].get("tag", "nothing")
        return f"{place}: got {tag!r}; {nearest(str(tag), filter(None, tags))}"
    message = detail["msg"].removeprefix("Value error, ")
    return f"{place}: got {detail.get('input')!r:.80}; {message[:1].lower()}{message[1:]}"


def _key_path(
    location: KeyPath,
    model: type[BaseModel],
    lines: dict[KeyPath, int],
    settings: list[tuple[str, ...]],
) -> KeyPath:
    """Leave out of an error's location what pydantic adds: tags of unions, names of types."""
    written = {part for path in (*lines, *settings) for part in path}
    at = []
    for index, part in enumerate(location):
        options = _follow(model, location[:index])
        is_field = str(part) in _fields(options)
        is_tag = any(part in _tags_of(option) for option in options)
        is_type = bool(lines) and 0 < index < len(location) - 1 and part not in written
        if is_field or not (is_tag or is_type):
            at.append(part)
    return tuple(at)


def _follow(model: type[BaseModel], location: KeyPath) -> list[type[BaseModel]]:
    """List the configs that may stand at a place."""
    options: list[type[BaseModel]] = [model]
    for part in location:
        found: list[type[BaseModel]] = []
        for option in options:
            for name, field in option.model_fields.items():
                if part in (name, field.alias):
                    found.extend(_models(field.annotation))
            if part in _tags_of(option) or isinstance(part, int):
                found.append(option)
        options = found or options
    return options


def _fields(options: list[type[BaseModel]]) -> list[str]:
    """List the keys that these configs allow."""
    named = (field.alias or name for one in options for name, field in one.model_fields.items())
    return list(dict.fromkeys(named))


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Find the config models inside a type annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]


def _tags_of(model: type[BaseModel]) -> tuple[Any, ...]:
    """Return what a model's ``method`` may be: its tags in a union."""
    field = model.model_fields.get("method")
    return () if field is None else get_args(field.annotation)
