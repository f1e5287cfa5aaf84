"""One kind of input that is broken and read."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fuzz.whole_files import Files


@dataclass(frozen=True)
class Target:
    """One kind of input.

    Attributes
    ----------
    files : function of nothing
        Whole files by name.
    broken : dict of str
        What breaks which of them.
    read : function of the folder
        What a command does with them.
    judge : function of folder and result
        Names of what is nonsense in it.
    share : int
        How often it is drawn.
    """

    files: Callable[[], Files]
    broken: dict[str, Callable[..., bytes]]
    read: Callable[[Path], Any]
    judge: Callable[[Path, Any], list[str]] = field(default=lambda folder, found: [])
    share: int = 4
