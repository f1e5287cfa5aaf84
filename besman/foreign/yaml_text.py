"""YAML from anywhere: plain values only, and no text grows into more than it shows.

PyYAML's safe loader runs nothing, but raises errors of its own and of Python for values that it
cannot make, recurses as deep as a text nests, and expands aliases without end.
"""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import Any

import yaml

DEEPEST = 64
"""Levels of lists and mappings in each other."""

MOST_NODES = 100_000
"""Keys and values of a text, those that aliases repeat counted each time."""

MOST_DIGITS = 19
"""Digits of an integer: those of 64 bits."""

_PLAIN = {
    f"tag:yaml.org,2002:{kind}"
    for kind in ("map", "seq", "str", "int", "float", "bool", "null", "merge")
}
_ERRORS = (ValueError, TypeError, KeyError, AttributeError, OverflowError, IndexError)


class YamlTextError(ValueError):
    """Text that is no YAML of plain values.

    Attributes
    ----------
    line : int
        From 1; 0 where it is not known.
    """

    def __init__(self, problem: str, line: int = 0) -> None:
        super().__init__(problem)
        self.line = line


# PyYAML has no types.
class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """The safe loader with plain values only, every error with its line."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node; refuse one that lies too deep."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise YamlTextError(
                f"lists and mappings lie in each other more than {DEEPEST} levels deep",
                self.peek_event().start_mark.line + 1,
            )
        node: yaml.Node | None = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Make the value of a node; refuse kinds that no config has."""
        line = node.start_mark.line + 1
        if node.tag not in _PLAIN:
            kind = node.tag.rpartition(":")[2]
            raise YamlTextError(f"a value of the kind {kind!r}; expected text or a number", line)
        if node.tag.endswith(":int") and len(str(node.value)) > MOST_DIGITS + 1:
            raise YamlTextError(f"an integer of {len(node.value)} digits", line)
        try:
            return super().construct_object(node, deep)
        except YamlTextError:
            raise
        except _ERRORS as error:
            problem = f"{node.value!r:.60} cannot be read ({error!s:.100})"
            raise YamlTextError(problem, line) from None


# A date is text here, as no config has one.
_Loader.yaml_implicit_resolvers = {
    first: [one for one in resolvers if one[0] in _PLAIN]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def parse_yaml(text: str) -> tuple[Any, yaml.Node | None]:
    """Parse one YAML document.

    Parameters
    ----------
    text : str

    Returns
    -------
    value : dict, list, str, int, float, bool or None
    node : yaml.Node or None
        The same with the place of everything, to read only; aliases are one node at several
        places.

    Raises
    ------
    YamlTextError
        If it is no YAML, holds other than plain values, keys that are lists or mappings, an alias
        inside of what it stands for, more than `MOST_NODES` nodes, or is nested deeper than
        `DEEPEST`.

    Notes
    -----
    A text is parsed once in a process: robots, tools and marker sets are read again and again, and
    parsing is nine tenths of it. Every value that is returned is the caller's own.
    """
    value, node = _parse(text)
    return copy.deepcopy(value), node


@lru_cache(maxsize=64)
def _parse(text: str) -> tuple[Any, yaml.Node | None]:
    """Parse one document; what is returned is shared, and not to be changed."""
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, None
        if _count(node, {}) > MOST_NODES:
            raise YamlTextError(f"more than {MOST_NODES} values, with those that aliases repeat")
        return loader.construct_document(node), node
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = ": ".join(filter(None, (error.context, error.problem))) or "cannot be read"
        raise YamlTextError(problem, mark.line + 1 if mark else 0) from None
    except yaml.YAMLError as error:
        raise YamlTextError(" ".join(str(error).split())) from None


def _count(node: yaml.Node, known: dict[int, int]) -> int:
    """Count the nodes below one, and itself, as often as aliases show them."""
    if id(node) not in known:
        # A node that meets itself before it is counted stands inside of itself.
        known[id(node)] = -1
        total = 1
        for child in _children(node):
            total += _count(child, known)
        known[id(node)] = total
    if known[id(node)] < 0:
        line = node.start_mark.line + 1
        raise YamlTextError("an alias inside of what it stands for", line)
    return known[id(node)]


def _children(node: yaml.Node) -> list[yaml.Node]:
    """Return what a node holds; refuse keys that are more than a word."""
    if isinstance(node, yaml.MappingNode):
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise YamlTextError(
                    "a key that is a list or mapping; expected a word", key.start_mark.line + 1
                )
        return [one for pair in node.value for one in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []
