"""Directive ``example-output``: what an example prints, from running it now.

An example runs again only when it, the package or the data changed. Examples run while the pages
are read; the page that shows them waits.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

TOP = Path(__file__).resolve().parents[2]
_SOURCES = ("besman", "data", "configs", "pipelines", "robots")


def run_example(path: Path) -> str:
    """Return what an example prints.

    Raises
    ------
    ExtensionError
        If it fails.
    """
    environment = os.environ | {"PYTHONPATH": str(TOP), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(  # noqa: S603
        [sys.executable, str(path)], capture_output=True, text=True, env=environment, cwd=TOP
    )
    if done.returncode:
        raise ExtensionError(f"{path.name} failed:\n{done.stderr}")
    return done.stdout


def digest_sources() -> str:
    """Return a checksum of everything that examples run on."""
    found = hashlib.sha256()
    for folder in _SOURCES:
        for path in sorted((TOP / folder).rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                found.update(str(path.relative_to(TOP)).encode())
                found.update(path.read_bytes())
    return found.hexdigest()


def start_examples(app: Any) -> None:
    """Begin to run all examples, two at a time; what they print is kept."""
    kept = Path(app.outdir).parent / "examples"
    kept.mkdir(parents=True, exist_ok=True)
    sources = digest_sources()

    def output(path: Path) -> str:
        key = hashlib.sha256(sources.encode() + path.read_bytes()).hexdigest()[:16]
        place = kept / f"{path.stem}-{key}.txt"
        if not place.is_file():
            text = run_example(path)
            for old in kept.glob(f"{path.stem}-*.txt"):
                old.unlink()
            place.write_text(text, encoding="utf-8")
        return place.read_text(encoding="utf-8")

    pool = ThreadPoolExecutor(2)
    # Those that take longest come first.
    paths = sorted((TOP / "examples").glob("[0-9]*.py"), reverse=True)
    app.example_outputs = {path.name: pool.submit(output, path) for path in paths}
    pool.shutdown(wait=False)


class ExampleOutput(SphinxDirective):
    """Show what an example prints."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write it as text."""
        name = self.arguments[0]
        self.env.note_dependency(str(TOP / "examples" / name))
        text = self.env.app.example_outputs[name].result()
        block = nodes.literal_block(text, text, language="text")
        return [block]


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("builder-inited", start_examples)
    app.add_directive("example-output", ExampleOutput)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
