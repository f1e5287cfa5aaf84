"""Equations as MathML, which browsers draw by themselves: no script, no font, no network."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

logger = logging.getLogger(__name__)

# The converter aligns lines by itself, and takes primes for letters.
_ALIGNED = re.compile(r"\\(begin|end)\{align\*?\}")
_PRIMES = re.compile(r"'+")


def convert(tex: str, node: nodes.Node, *, block: bool) -> str:
    """Return the MathML of an equation; one that cannot be converted is a warning."""
    text = _ALIGNED.sub("", tex).strip()
    text = _PRIMES.sub(lambda found: "^{" + len(found[0]) * r"\prime" + "}", text)
    try:
        return str(tex2mathml(text, as_block=block))
    except (MathError, ValueError, IndexError, AttributeError) as error:
        logger.warning("equation not understood: %s: %s", error, tex, location=node)
        return ""


def visit_math(self: Any, node: nodes.Node) -> None:
    """Write an equation within a line."""
    self.body.append(convert(node.astext(), node, block=False))
    raise nodes.SkipNode


def visit_math_block(self: Any, node: Any) -> None:
    """Write an equation on lines of its own."""
    names = f' id="{node["ids"][0]}"' if node["ids"] else ""
    self.body.append(f'<div class="math"{names}>{convert(node.astext(), node, block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
