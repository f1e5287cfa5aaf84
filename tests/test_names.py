"""One public name, one thing: classes and functions that bear the same name in two modules."""

import ast
from collections import defaultdict

from places import TOP
from sources import tree

# A command bears the name of what it runs: `besman transfer suggest` is `suggest` in both.
_COMMANDS = "besman.cli."


def find_public_names(package):
    """Return the modules that define each public class or function, by its name."""
    found = defaultdict(set)
    for path in sorted(package.rglob("*.py")):
        module = ".".join(path.relative_to(package.parent).with_suffix("").parts)
        for node in tree(path).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
                found[node.name].add(module)
    return found


def shared_names(package):
    """Return the names that more than one module defines, and which those are."""
    return {
        name: sorted(modules)
        for name, modules in find_public_names(package).items()
        if len({one for one in modules if not one.startswith(_COMMANDS)}) > 1
    }


def test_no_two_modules_define_the_same_public_name():
    assert shared_names(TOP / "besman") == {}


def test_no_two_modules_of_commands_define_the_same_command():
    commands = find_public_names(TOP / "besman" / "cli")
    assert {name: sorted(one) for name, one in commands.items() if len(one) > 1} == {}


def test_this_check_sees_what_it_looks_for(tmp_path):
    texts = {
        "view": "class Take: pass\ndef _near(): pass\nclass Alone: pass",
        "annotate": "class Take: pass\ndef _near(): pass\ndef suggest(): pass",
        "cli/annotate": "def suggest(): pass\nclass Alone: pass",
    }
    for name, text in texts.items():
        path = tmp_path / "besman" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert shared_names(tmp_path / "besman") == {"Take": ["besman.annotate", "besman.view"]}
