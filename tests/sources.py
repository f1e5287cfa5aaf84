"""The modules of besman as trees, each parsed once for all tests of how the code is written."""

import ast
from functools import cache


@cache
def nodes(path):
    """Return every node of a file, its module first, in the order of `ast.walk`; to read only."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def tree(path):
    """Return the module of a file, to read only."""
    return nodes(path)[0]
