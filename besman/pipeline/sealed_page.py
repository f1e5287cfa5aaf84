"""A page made of a run says by its last line that it is whole, and of what it was made."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

PAGE = "report.html"
_SEAL = re.compile(rb"<!-- besman: sha256 ([0-9a-f]{64}), of ([0-9a-f]{64}) -->\n\Z")


def seal(page: str, of: str) -> str:
    """Add the last line to a page.

    Parameters
    ----------
    page : str
        HTML that ends in a line end.
    of : str
        Digest of what it was made of.
    """
    sha = hashlib.sha256(page.encode()).hexdigest()
    return f"{page}<!-- besman: sha256 {sha}, of {of} -->\n"


def fault_of_page(path: Path, of: str) -> str | None:
    """Say what is wrong with a page, if something is.

    Parameters
    ----------
    path : Path
    of : str
        Digest of what it should be made of.
    """
    content = path.read_bytes()
    found = _SEAL.search(content)
    if found is None or hashlib.sha256(content[: found.start()]).hexdigest() != found[1].decode():
        return "is cut or changed"
    return None if found[2].decode() == of else "shows what the run was before"
