"""Expand a xacro: run as a process of its own, which may read some folders and do nothing else.

xacro evaluates Python expressions. Here they may call what xacro offers, but no name that leads out
of it; and whatever the process tries besides reading below the folders it is given is refused by
an audit hook, which nothing can take off again. Input and output are JSON.
"""

from __future__ import annotations

import ast
import io
import json
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

# What leads from a value to frames, code and modules.
_INNARDS = ("_", "f_", "gi_", "cr_", "ag_", "tb_", "co_", "func_")
_LEADS_OUT = {"mro", "format", "format_map", "vars", "type", "fromhex"}
_USED = re.compile(r"""(?:\$\(arg\s+|xacro\.arg\(['"])(\w+)""")
# Files of before 2014 write these without a prefix; no URDF has elements called so below its root.
_OLD_TAGS = ("property", "macro", "include", "arg")
_DECLARATIONS = ("<!DOCTYPE", "<!ENTITY")
_MOST_CHARACTERS = 20_000_000
# An expression is a number or a name.
_LONGEST_EXPRESSION, _GREATEST_POWER = 2000, 10
_CPU_S, _MEMORY_BYTES = 30, 2_000_000_000
_HARMLESS = ("os.listdir", "os.scandir", "glob.glob", "glob.glob/2", "object.__getattr__")
_REFUSED = ("os.", "shutil.", "socket.", "subprocess.", "ctypes.", "pty.", "mmap.", "winreg.")


class RefusedError(Exception):
    """What a xacro may not do."""


def check_expression(text: str, has_builtins: bool = False) -> None:
    """Refuse an expression that leads out of xacro.

    Parameters
    ----------
    text : str
    has_builtins : bool, optional
        Whether names that no file defines are Python's, as in ``$(eval ...)``.

    Raises
    ------
    RefusedError
        If it defines functions, uses names or attributes that lead to Python's innards, or is very
        long.
    """
    if len(text) > _LONGEST_EXPRESSION:
        raise RefusedError(f"an expression of {len(text)} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, RecursionError, ValueError):
        # xacro says so.
        return
    for node in ast.walk(tree):
        attribute, name = getattr(node, "attr", ""), getattr(node, "id", "")
        # A file's own names may be called like anything.
        strange = name.startswith("__") or (has_builtins and name in _LEADS_OUT)
        if strange or attribute.startswith(_INNARDS) or attribute in _LEADS_OUT:
            raise RefusedError(f"the name {attribute or name!r} in the expression {text!r:.80}")
        if isinstance(node, ast.Lambda | ast.NamedExpr | ast.Await | ast.Yield | ast.GeneratorExp):
            raise RefusedError(f"{type(node).__name__} in the expression {text!r:.80}")
        if isinstance(node, ast.BinOp) and not _is_small(node):
            raise RefusedError(f"a large power in the expression {text!r:.80}")


def _is_small(node: ast.BinOp) -> bool:
    """Tell whether an operation is no large power, as far as it can be told from its text."""
    if not isinstance(node.op, ast.Pow | ast.LShift):
        return True
    for part in ast.walk(node.right):
        if isinstance(part, ast.BinOp) and isinstance(part.op, ast.Pow | ast.LShift):
            return False
        value = getattr(part, "value", 0)
        if isinstance(part, ast.Constant) and not (
            isinstance(value, int | float) and value <= _GREATEST_POWER
        ):
            return False
    return True


def expand(task: Mapping[str, Any]) -> dict[str, Any]:
    """Expand one file.

    Parameters
    ----------
    task : dict
        ``file``, ``folders`` (all that may be read), ``packages`` (folders by name), ``arguments``
        (values by name).

    Returns
    -------
    dict
        ``urdf`` with so many ``links``, or ``error``, whether it is ``refused``, and the
        ``package`` that is not known; ``declared``: arguments with their defaults, None for those
        that are used and have none; ``macros`` by name.
    """
    try:
        import xacro
        import xacro.substitution_args as substitution
    except ImportError as error:
        return {"error": str(error), "declared": {}, "macros": []}
    told: dict[str, Any] = {}
    declared: dict[str, str | None] = {}
    macros: list[str] = []
    _close_ways_out(xacro, substitution, task["packages"], told)
    _watch_parsing(xacro, declared, macros)
    sys.addaudithook(guard([Path(one) for one in task["folders"]]))
    messages, sys.stderr = sys.stderr, io.StringIO()
    try:
        document = xacro.process_file(task["file"], mappings=dict(task["arguments"]), verbosity=0)
        told["urdf"] = document.toxml()
        told["links"] = len(document.getElementsByTagName("link"))
    except RefusedError as error:
        told |= {"error": str(error), "refused": True}
    except RecursionError:
        told["error"] = "macros that call each other without end"
    except Exception as error:
        told["error"] = " ".join(str(error).split()) or type(error).__name__
        cause: Any = error
        while cause is not None and not isinstance(cause, RefusedError):
            cause = getattr(cause, "exc", None)
        if cause is not None:
            told |= {"error": str(cause), "refused": True}
    finally:
        sys.stderr = messages
    return told | {"declared": declared, "macros": macros}


def _close_ways_out(xacro: Any, substitution: Any, packages: Mapping[str, str], told: Any) -> None:
    """Have xacro check expressions, find packages among those that are given, and ask no more."""
    evaluate, evaluate_argument = xacro.safe_eval, substitution._eval

    def checked(expression: str, *scopes: Any) -> Any:
        check_expression(expression)
        return evaluate(expression, *scopes)

    def checked_argument(expression: str, context: Any) -> Any:
        check_expression(expression, has_builtins=True)
        return evaluate_argument(expression, context)

    def find(package: str) -> str:
        if package not in packages:
            told["package"] = package
            raise RefusedError(f"package {package!r} is not known")
        return packages[package]

    def environment(name: str, default: str | None = None) -> str:
        if default is None:
            raise RefusedError(f"the environment variable {name!r}")
        return default

    xacro.safe_eval, substitution._eval = checked, checked_argument
    substitution._eval_find, substitution._eval_env = find, environment
    substitution._eval_optenv = lambda name, default="": environment(name, default)
    own = {"find": find, "env": environment, "optenv": substitution._eval_optenv}
    substitution._eval_dict.update(own)
    for name in ("vars", "type"):
        xacro._global_symbols["python"].pop(name, None)


def _watch_parsing(xacro: Any, declared: dict[str, str | None], macros: list[str]) -> None:
    """Refuse document types and entities in every file, read old ones; note arguments, macros."""
    parse = xacro.parse

    def careful(given: Any, filename: str | None = None) -> Any:
        if given is None and filename is not None:
            with open(filename, encoding="utf-8") as file:
                given = file.read(_MOST_CHARACTERS + 1)
            if len(given) > _MOST_CHARACTERS or any(one in given for one in _DECLARATIONS):
                raise RefusedError(f"{filename}: document types, entities, or more than 20 MB")
            for name in _USED.findall(given):
                declared.setdefault(name, None)
            given = given.encode()
        document = parse(io.BytesIO(given) if isinstance(given, bytes) else given, filename)
        for node in list(document.documentElement.childNodes):
            if getattr(node, "tagName", "") in _OLD_TAGS:
                document.renameNode(node, node.namespaceURI, f"xacro:{node.tagName}")
        for node in document.getElementsByTagName("xacro:macro"):
            macros.append(node.getAttribute("name"))
        for node in document.getElementsByTagName("xacro:arg"):
            declared[node.getAttribute("name")] = node.getAttribute("default")
        return document

    xacro.parse = careful


def guard(folders: Sequence[Path]) -> Callable[[str, tuple[Any, ...]], None]:
    """Return an audit hook that lets files below some folders be read, and nothing else happen.

    Parameters
    ----------
    folders : sequence of Path
    """
    allowed = [os.path.realpath(folder) for folder in folders]

    def look(event: str, details: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode = details[0], details[1]
            if isinstance(path, int):
                return
            real = os.path.realpath(os.fsdecode(path))
            inside = any(os.path.commonpath([real, one]) == one for one in allowed)
            if not inside or set(mode or "r") & set("wax+"):
                raise RefusedError(f"the file {real!r:.200}, which is outside")
        elif event.startswith(_REFUSED) and event not in _HARMLESS:
            raise RefusedError(f"{event} in a xacro")

    return look


def main() -> None:
    """Read the task from standard input, write what came of it to standard output."""
    try:
        import resource
    except ImportError:
        pass
    else:
        resource.setrlimit(resource.RLIMIT_CPU, (_CPU_S, _CPU_S))
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    # What xacro would load later on could not be loaded then.
    import glob  # noqa: F401
    import xml.dom.expatbuilder
    import xml.dom.minidom  # noqa: F401

    import yaml  # noqa: F401

    task = json.load(sys.stdin)
    out, sys.stdout = sys.stdout, io.StringIO()
    out.write(json.dumps(expand(task)))


if __name__ == "__main__":
    main()
