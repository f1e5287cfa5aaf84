"""Broken files out of whole ones: what a bad transfer, a bad export or a bad mind makes of them.

Every function takes a random generator and bytes and returns bytes; the same generator gives the
same bytes. None knows how besman reads: they know the formats only.
"""

import json
import re

import yaml
from fuzz.odd_values import NAMES, NUMBERS

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
_WORD = re.compile(r"[A-Za-z_][\w -]*[A-Za-z_\d]")


def text(rng, content):
    """Break any text: lines, numbers, words, single bytes, encoding, end."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice(_TEXT)(rng, content)
    return content


def _decoded(function):
    def change(rng, content):
        return function(rng, content.decode("utf-8", "surrogateescape")).encode(
            "utf-8", "surrogateescape"
        )

    return change


def cut(rng, content):
    """End anywhere: a transfer that broke off."""
    return content[: rng.randrange(len(content) + 1)]


def flip(rng, content):
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8))):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def splice(rng, content):
    start, end = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    piece = content[start : min(end, start + 200)]
    at = rng.randrange(len(content) + 1)
    return content[:at] + piece * rng.choice((0, 1, 1, 3)) + content[at:]


def _encode(rng, content):
    plain = content.decode("utf-8", "replace")
    name = rng.choice(("utf-16", "utf-8-sig", "latin-1", "utf-32", "cp037"))
    return plain.encode(name, "replace")


@_decoded
def _lines(rng, content):
    lines = content.split("\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    action = rng.randrange(6)
    if action == 0:
        del lines[at]
    elif action == 1:
        lines.insert(other, lines[at])
    elif action == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif action == 3:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    elif action == 4:
        return "\r\n".join(lines) if rng.random() < 0.5 else "\r".join(lines)
    else:
        lines.insert(at, "")
    return "\n".join(lines)


def _replaced(rng, content, pattern, new):
    found = list(pattern.finditer(content))
    if not found:
        return content
    # Half of the time near the start, where headers are.
    one = rng.choice(found[:60] if rng.random() < 0.5 else found)
    return content[: one.start()] + new + content[one.end() :]


@_decoded
def _number(rng, content):
    return _replaced(rng, content, _NUMBER, rng.choice(NUMBERS))


@_decoded
def _word(rng, content):
    return _replaced(rng, content, _WORD, rng.choice(NAMES))


@_decoded
def _insert(rng, content):
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice(NUMBERS + NAMES) + content[at:]


_TEXT = (cut, flip, splice, _lines, _lines, _number, _number, _number, _word, _word, _insert)
_TEXT = (*_TEXT, _encode, *_TEXT)


@_decoded
def _cells(rng, content):
    """Change one cell of a table; the header's as often as the numbers'."""
    lines = content.split("\n")
    row = rng.randrange(min(14, len(lines)) if rng.random() < 0.5 else len(lines))
    separator = "\t" if "\t" in content else ","
    cells = lines[row].split(separator)
    values = NUMBERS if rng.random() < 0.7 else NAMES
    cells[rng.randrange(len(cells))] = rng.choice(values)
    lines[row] = separator.join(cells)
    return "\n".join(lines)


@_decoded
def _column(rng, content):
    """Stretch all numbers of one column, as another unit does."""
    lines = content.split("\n")
    separator = "\t" if "\t" in content else ","
    column = rng.randrange(lines[-2].count(separator) + 1) if len(lines) > 1 else 0
    factor = rng.choice((1e6, 1e3, 1e-3, -1.0, 0.0, 1e300))
    for row, line in enumerate(lines):
        cells = line.split(separator)
        if len(cells) > column and _NUMBER.fullmatch(cells[column]) and len(cells) > 5:
            cells[column] = repr(float(cells[column]) * factor)
        lines[row] = separator.join(cells)
    return "\n".join(lines)


def table(rng, content):
    """Break a table: TSV or CSV with a header."""
    action = rng.random()
    if action < 0.4:
        return _cells(rng, content)
    return _column(rng, content) if action < 0.45 else text(rng, content)


DEEP = (100_000, 3_000, 200)


def nest(rng, inside):
    depth = rng.choice(DEEP)
    return "[" * depth + inside + "]" * depth


def tree(rng, value):
    """Break a tree of mappings, lists and leaves in one place."""
    places = []

    def visit(node):
        pairs = node.items() if isinstance(node, dict) else enumerate(node)
        for key, child in list(pairs):
            places.append((node, key))
            if isinstance(child, dict | list):
                visit(child)

    if not isinstance(value, dict | list) or not value:
        return rng.choice(LEAVES)
    visit(value)
    node, key = rng.choice(places)
    action = rng.randrange(8)
    if action == 0:
        del node[key]
    elif action == 1 and isinstance(node, list):
        node.insert(rng.randrange(len(node) + 1), node[key])
    elif action == 1:
        node[str(rng.choice(NAMES))] = node[key]
    elif action == 2 and isinstance(node, dict):
        node[str(rng.choice(NAMES + NUMBERS))] = node.pop(key)
    elif action == 3:
        node[key] = [node[key]]
    elif action == 4:
        node[key] = {"x": node[key]}
    elif action == 5 and isinstance(node[key], int | float):
        node[key] = node[key] * rng.choice((-1, 0, 1000, 1e6, 1e300, 0.5, 1e-9))
    else:
        node[key] = rng.choice(LEAVES)
    return value


LEAVES = [
    None, True, False, 0, -1, 1, 2, 7, 400, 10**6, 10**21, -(10**21), 10**300, 1e300, -1e300,
    1e-300, float("nan"), float("inf"), 0.5, 1000.5, [], {}, [1, 2, 3], [[1], [2]], {"a": 1}, "1",
    "1e3",
    "1_000", "nan", *NAMES,
]  # fmt: skip


def json_file(rng, content):
    """Break JSON, as a tree or as text."""
    action = rng.random()
    if action < 0.3:
        return text(rng, content)
    if action < 0.34:
        return nest(rng, content.decode()).encode()
    if action < 0.37:
        return re.sub(rb"\d+", b"9" * 5000, content, count=1)
    return json.dumps(tree(rng, json.loads(content))).encode("utf-8", "surrogatepass")


_YAML_LINES = [
    "2020-99-99", "2001-12-14t21:59:43.10-05:00", "!!python/object/apply:os.getcwd []", "*nowhere",
    "&a [*a]", "!!set {a, b}", "!!binary x", "!!timestamp x", "!!float x", "!!int x", "!!bool x",
    "!!omap [a: 1]", "!!pairs [[a]]", "!!null x", "!!map [a]", "!!seq {a: 1}", "!!str [a]", "!x y",
    "190:20:30", "0o17", "0b12", "0x_", "1e999", ".nan", ".inf", "-.inf", "~", "yes", "[]", "{}",
    "{[a]: b}", "{{a: 1}: b}", "? [a]", "<<: 3", "{<<: 3}", "{<<: [1, 2]}", "=", "!!value =", "|",
    ">", "%", "@x", "`x", "'x", '"\\x"', '"\\uD800"', '"\\x00"', "- a", "a: b: c", "[a, [b", "#",
    "9" * 5000, "-" + "9" * 5000, "1:" * 3000 + "1", "1e" + "9" * 20,
]  # fmt: skip


def _bomb(rng):
    width, levels = rng.choice(((9, 7), (9, 4), (2, 30), (50, 3)))
    lines = ["a0: &a0 [1]"]
    for level in range(1, levels):
        lines.append(f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * width)}]")
    return "\n".join(lines) + "\n"


@_decoded
def _yaml_value(rng, content):
    lines = content.split("\n")
    at = rng.choice([k for k, line in enumerate(lines) if ":" in line] or [0])
    key, colon, _ = lines[at].partition(":")
    lines[at] = key + colon + " " + rng.choice(_YAML_LINES + NUMBERS + NAMES)
    return "\n".join(lines)


@_decoded
def _yaml_odd(rng, content):
    action = rng.randrange(5)
    if action == 0:
        return content + "\n" + _bomb(rng)
    if action == 1:
        return content + "\nx: " + nest(rng, "1")
    if action == 2:
        return content + "\n? " + rng.choice(_YAML_LINES) + "\n: 1\n"
    if action == 3:
        return rng.choice(_YAML_LINES)
    return content + "\n---\n" + content


def yaml_file(rng, content):
    """Break YAML, as a tree, line by line or as text."""
    action = rng.random()
    if action < 0.2:
        return text(rng, content)
    if action < 0.5:
        return _yaml_value(rng, content)
    if action < 0.6:
        return _yaml_odd(rng, content)
    return yaml.safe_dump(tree(rng, yaml.safe_load(content)), sort_keys=False).encode(
        "utf-8", "surrogatepass"
    )


@_decoded
def settings(rng, content):
    """Break one of several ``KEY=VALUE``, a line each."""
    lines = content.split("\n")
    at = rng.randrange(len(lines))
    key, _, value = lines[at].partition("=")
    if rng.random() < 0.3:
        key = rng.choice((*NAMES, key + "." + rng.choice(NAMES), key.partition(".")[0]))
    else:
        value = rng.choice(_YAML_LINES + NUMBERS + NAMES + [_bomb(rng), nest(rng, "1")])
    lines[at] = (key + rng.choice("=====:") + value).replace("\n", "\r")
    return "\n".join(lines)


_ATTRIBUTE = re.compile(r'(?<=[ \n])([\w:]+)="([^"]*)"')
_ELEMENT = re.compile(r"<(\w+)[^<>]*/>|<(\w+)[^<>]*>[^<>]*</\2>")


@_decoded
def _attribute(rng, content):
    found = list(_ATTRIBUTE.finditer(content))
    if not found:
        return content
    one = rng.choice(found)
    old = one.group(2).split()
    values = NUMBERS if old and _NUMBER.fullmatch(old[0]) and rng.random() < 0.8 else NAMES
    new = rng.choice(values)
    if len(old) > 1 and rng.random() < 0.7:
        old[rng.randrange(len(old))] = new
        new = " ".join(old)
    new = new.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    new = new.replace("\n", "&#10;").replace("\x1b", "&#27;").replace("\t", "&#9;")
    return content[: one.start(2)] + new + content[one.end(2) :]


@_decoded
def _element(rng, content):
    found = list(_ELEMENT.finditer(content))
    if not found:
        return content
    one, action = rng.choice(found), rng.randrange(4)
    if action == 0:
        return content[: one.start()] + content[one.end() :]
    if action == 1:
        other = rng.choice(found)
        return content[: other.start()] + one.group() + content[other.start() :]
    if action == 2:
        depth = rng.choice(DEEP)
        deep = "<x>" * depth + "</x>" * depth
        return content[: one.start()] + deep + content[one.start() :]
    return "<!DOCTYPE x [<!ENTITY a 'b'>]>" + content


def xml_file(rng, content):
    """Break XML: attributes, elements, text."""
    action = rng.random()
    if action < 0.55:
        return _attribute(rng, content)
    return _element(rng, content) if action < 0.75 else text(rng, content)
