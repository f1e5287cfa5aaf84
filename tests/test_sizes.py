"""How long files and functions may be, and how many ways may lead through one.

A function that is longer or more branched says "In one piece" in its docstring, and why.
"""

import ast

from places import TOP
from sources import nodes

MOST_LINES = 400
MOST_FUNCTION_LINES = 60
MOST_WAYS = 20
REASON = "In one piece"


def count_lines(function):
    """Return the lines of a function without its docstring, which is as long as it need be."""
    documentation = function.body[0] if ast.get_docstring(function) is not None else None
    lines = function.end_lineno - function.lineno + 1
    return lines - (documentation.end_lineno - documentation.lineno + 1 if documentation else 0)


def count_ways(function):
    """Return the cyclomatic complexity (T. J. McCabe, 1976), every `and` and `or` counted."""
    ways = 1
    for node in ast.walk(function):
        if isinstance(node, ast.If | ast.IfExp | ast.Assert | ast.match_case | ast.ExceptHandler):
            ways += 1
        elif isinstance(node, ast.For | ast.AsyncFor | ast.While):
            ways += 2 if node.orelse else 1
        elif isinstance(node, ast.BoolOp):
            ways += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            ways += 1 + len(node.ifs)
    return ways


def too_much(package):
    """Return the files and functions that are too long or too branched, and do not say why."""
    found = []
    for path in sorted(package.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        name = path.relative_to(package).as_posix()
        if text.count("\n") > MOST_LINES:
            found.append(f"{name}: {text.count(chr(10))} lines")
        for node in nodes(path):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            if REASON in (ast.get_docstring(node) or ""):
                continue
            lines, ways = count_lines(node), count_ways(node)
            if lines > MOST_FUNCTION_LINES:
                found.append(f"{name}: {node.name}: {lines} lines")
            if ways > MOST_WAYS:
                found.append(f"{name}: {node.name}: {ways} ways through it")
    return found


def test_files_and_functions_are_no_longer_than_can_be_read_at_once():
    assert too_much(TOP / "besman") == []


def test_this_check_sees_what_it_looks_for(tmp_path):
    functions = {
        "long": ["    pass"] * 60,
        "enough": ["    pass"] * 59,
        "documented": ['    """Do it.', *["    More."] * 70, '    """', *["    pass"] * 59],
        "told": ['    """In one piece: so."""', *["    pass"] * 60],
        "ways": ["    return " + " or ".join(21 * ["this"])],
        "few": ["    return " + " or ".join(20 * ["this"])],
    }
    lines = [line for name, body in functions.items() for line in (f"def {name}():", *body)]
    (tmp_path / "functions.py").write_text("\n".join(lines))
    (tmp_path / "long.py").write_text(401 * "\n")
    assert too_much(tmp_path) == [
        "functions.py: long: 61 lines",
        "functions.py: ways: 21 ways through it",
        "long.py: 401 lines",
    ]
