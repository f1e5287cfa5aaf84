"""A run as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from besman.exceptions import RunError
from besman.io.atomic_files import check_file, check_folder, make_folder, write_text
from besman.view.assets import read_asset
from besman.view.run_content import RATE_HZ, RunContent

_WANTED_BYTES, _LARGEST_BYTES = 1_000_000, 3_000_000
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w/]+)\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


def write_replay(
    content: RunContent,
    out: Path,
    motion: str | None = None,
    rate_hz: float = RATE_HZ,
    progress: Callable[[float], None] = lambda done: None,
) -> tuple[int, int]:
    """Write a run as one HTML file, of at most three megabytes.

    Parameters
    ----------
    content : RunContent
        What the run has to show.
    out : Path
        The file; its name ends in .html.
    motion : str, optional
        The one demonstration to show; all if not given. Where all are too much, they have half as
        many frames; where that is too much still, some are left out, evenly in their order.
    rate_hz : float
        Frames per second, at most.
    progress : callable
        Told the share that is done.

    Returns
    -------
    pair of int
        Demonstrations shown, and all.

    Raises
    ------
    RunError
        If there is no such demonstration, or the file cannot be written.
    """
    if out.suffix != ".html":
        raise RunError(f"--export: got {out}, expected a name that ends in .html")
    check_folder(out.parent, f"{out}", RunError)
    if out.parent.is_dir():
        check_file(out, kind=RunError)
    first = content.first if motion is None else content.find(motion)
    chosen = list(range(len(content.names))) if motion is None else [first]
    empty = len(_page(content.overview(chosen, first), []))
    chosen, bundles = _fit(content, chosen, first, empty, rate_hz, progress)
    page = _page(content.overview(chosen, first), bundles)
    make_folder(out.parent, kind=RunError)
    write_text(out, page, kind=RunError)
    return len(chosen), len(content.names)


def _fit(
    content: RunContent,
    chosen: list[int],
    first: int,
    empty: int,
    most_hz: float,
    progress: Callable[[float], None],
) -> tuple[list[int], list[bytes]]:
    """Pack so many demonstrations with so many frames that they fit beside `empty` bytes."""
    for rate_hz in (most_hz, most_hz / 2):
        packed = {first: content.demonstration(first, rate_hz)}
        one = _encoded([packed[first]])
        if empty + one * len(chosen) <= _WANTED_BYTES:
            break
    # Others may be longer than the first.
    room = int(0.8 * (_LARGEST_BYTES - empty) / one)
    chosen = _evenly(chosen, first, max(room, 1))
    while True:
        for done, index in enumerate(chosen):
            # Each is simulated again to be packed: once is enough.
            if index not in packed:
                packed[index] = content.demonstration(index, rate_hz)
            progress((done + 1) / len(chosen))
        bundles = [packed[index] for index in chosen]
        if empty + _encoded(bundles) <= _LARGEST_BYTES or len(chosen) == 1:
            return chosen, bundles
        chosen = _evenly(chosen, first, len(chosen) * 3 // 4)


def _encoded(bundles: list[bytes]) -> int:
    """Return how many letters bundles take as base64."""
    return sum(4 * (len(one) // 3 + 1) for one in bundles)


def _evenly(items: list[int], always: int, most: int) -> list[int]:
    """Keep at most so many, evenly spaced in their order, one of them always."""
    if len(items) <= most:
        return items
    rows = np.rint(np.linspace(0, len(items) - 1, most)).astype(int)
    kept = [items[row] for row in rows]
    if always not in kept:
        kept[int(np.abs(np.array(kept) - always).argmin())] = always
    return kept


def _page(overview: bytes, bundles: list[bytes]) -> str:
    """Put styles, modules and data into the page."""
    style = read_asset("web/theme.css") + read_asset("view.css")
    script = _join_modules("view")
    policy = (
        f"default-src 'none'; script-src {_source(script)}; style-src {_source(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    page = re.sub(r'<link rel="stylesheet"[^>]*>\n', "", read_asset("index.html"))
    page = page.replace('<script type="module" src="view.js"></script>\n', "")
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{style}</style>\n'
    )
    data = {"overview": overview} | {f"demonstration-{k}": one for k, one in enumerate(bundles)}
    blocks = "".join(
        f'<script type="text/plain" id="{name}">{base64.b64encode(one).decode()}</script>\n'
        for name, one in data.items()
    )
    page = page.replace('<meta charset="utf-8">\n', f'<meta charset="utf-8">\n{head}')
    return page.replace("</body>", f'{blocks}<script type="module">{script}</script>\n</body>')


def _source(text: str) -> str:
    """Return what a policy calls an inline script or style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _join_modules(name: str) -> str:
    """Return a module and all that it imports as one text, each in a scope of its own."""
    done: list[str] = []
    texts: list[str] = []

    def add(module: str) -> None:
        if module in done:
            return
        done.append(module)
        text = read_asset(f"{module}.js")
        for _, other in _IMPORT.findall(text):
            add(other)
        text = _IMPORT.sub(_constants, text)
        names = ", ".join(_EXPORT.findall(text))
        body = _EXPORT.sub("", text)
        texts.append(f"const {_scope(module)} = (() => {{\n{body}\nreturn {{ {names} }};\n}})();\n")

    add(name)
    # What would end the element that the script stands in.
    return "".join(texts).replace("</", "<\\/")


def _constants(found: re.Match[str]) -> str:
    """Turn an import into constants."""
    return f"const {{{found[1].replace(' as ', ': ')}}} = {_scope(found[2])};\n"


def _scope(module: str) -> str:
    return "module_" + module.replace("/", "_")
