"""Settings of the command line: ``KEY=VALUE`` over what a file says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from besman.exceptions import ConfigError
from besman.foreign.yaml_text import YamlTextError, parse_yaml

PathKeys = Mapping[str, Callable[[Any, Path], Any]]
"""Dotted keys whose values are paths, each with what makes it absolute."""


def parse_setting(setting: str, example: str) -> tuple[str, Any]:
    """Return key and value of one ``KEY=VALUE``.

    Parameters
    ----------
    setting : str
        The value is YAML.
    example : str
        Shown in an error.

    Raises
    ------
    ConfigError
        If it is not of this form.
    """
    key, equals, text = setting.partition("=")
    if not equals or not key:
        raise ConfigError(f"--set: got {setting!r}, expected KEY=VALUE, e.g. {example}")
    try:
        return key, parse_yaml(text)[0]
    except YamlTextError as error:
        raise ConfigError(
            f"--set {key}: got {text!r:.80}, which is not a YAML value: {error}"
        ) from None


def apply_settings(
    content: dict[str, Any],
    settings: tuple[str, ...],
    config: type[BaseModel],
    paths: PathKeys,
) -> None:
    """Put settings into the content of a file.

    A setting of another method leaves out what the file says of options that only the file's own
    method has.

    Parameters
    ----------
    content : dict
        Changed in place.
    settings : tuple of str
        Keys are dotted; paths in values are relative to the working directory.
    config : type
        What the content is checked against later on.
    paths : mapping
        Keys whose values are paths.

    Raises
    ------
    ConfigError
        If a setting is not ``KEY=VALUE``, or a key is below a value.
    """
    pairs = [parse_setting(setting, "select.label=throw") for setting in settings]
    for key, value in pairs:
        section, _, option = key.partition(".")
        if option == "method" and isinstance(content.get(section), dict):
            _leave_out_other_options(content[section], value, config, section)
    for key, value in pairs:
        _put(content, key, value)
        # Of a whole section that is set, too.
        own = {path: make for path, make in paths.items() if f"{path}.".startswith(f"{key}.")}
        resolve_paths(content, Path.cwd(), own)


def _leave_out_other_options(
    written: dict[str, Any], method: Any, config: type[BaseModel], section: str
) -> None:
    """Leave out options that another method of a section has and this one has not."""
    field = config.model_fields.get(section)
    known, own = set[str](), set[str]()
    for variant in get_args(field.annotation) if field is not None else ():
        options = set(variant.model_fields)
        known |= options
        if method in get_args(variant.model_fields["method"].annotation):
            own |= options
    if own:
        for option in (known - own) & set(written):
            del written[option]


def _put(content: dict[str, Any], key: str, value: Any) -> None:
    """Put the value of a dotted key into a file's content."""
    *parents, last = key.split(".")
    for parent in parents:
        content = content.setdefault(parent, {})
        if not isinstance(content, dict):
            raise ConfigError(f"--set {key}: {parent!r} is a value and has no keys below it")
    content[last] = value


def resolve_paths(content: dict[str, Any], folder: Path, paths: PathKeys) -> None:
    """Make the paths in a file's content absolute.

    Parameters
    ----------
    content : dict
        Changed in place; what is not there, or no section, is left for the config's own check.
    folder : Path
        To which they are relative.
    paths : mapping
        Keys whose values are paths.
    """
    for key, make in paths.items():
        *parents, last = key.split(".")
        section: Any = content
        for parent in parents:
            section = section.get(parent) if isinstance(section, dict) else None
        if isinstance(section, dict) and last in section:
            section[last] = make(section[last], folder)


def absolute(paths: Any, folder: Path) -> Any:
    """Make paths absolute; what is no path is left for the config's own check."""
    if isinstance(paths, str):
        return _below(folder, paths)
    if isinstance(paths, list):
        return [absolute(path, folder) for path in paths]
    return paths


def own_file(name: Any, folder: Path) -> Any:
    """Make the path of a user's own file absolute; a resource's name stays as it is."""
    is_path = isinstance(name, str) and name.endswith(".yaml")
    return _below(folder, name) if is_path else name


def _below(folder: Path, path: str) -> str:
    """Make a path absolute; a text that no path can be is left for the config's own check."""
    try:
        return str((folder / path).resolve())
    except (OSError, ValueError):
        return path
