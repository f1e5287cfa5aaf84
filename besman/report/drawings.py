"""Figures of a page that are drawn side by side: first what is to be drawn, then all at once."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from besman.work.work import Work

# In no text that is shown.
_PLACE = re.compile("\x00([0-9]+)\x00")


class DrawFigure(Protocol):
    """Gives what stands for a figure in a page's text."""

    def __call__(self, figure: Callable[..., str], *content: Any) -> str:
        """Have `figure` of a module called with its content; it returns SVG."""


def draw_now(figure: Callable[..., str], *content: Any) -> str:
    """Draw a figure here and now."""
    return figure(*content)


class Drawings:
    """Figures that are yet to be drawn: each has a place in the text until `fill`."""

    def __init__(self) -> None:
        self._asked: list[Callable[[], str]] = []

    def __call__(self, figure: Callable[..., str], *content: Any) -> str:
        """Take a figure to be drawn; return its place."""
        self._asked.append(partial(figure, *content))
        return f"\x00{len(self._asked) - 1}\x00"

    def fill(self, texts: list[str], work: Work) -> list[str]:
        """Draw all figures, and put each in its place.

        Parameters
        ----------
        texts : list of str
            With places.
        work : Work
            Processes; without them the figures are drawn one after the other, because threads
            cannot share Matplotlib.

        Returns
        -------
        list of str
        """
        if work.workers is None:
            work = Work(progress=work.progress)
        drawn = work.map(_draw, self._asked, name=lambda one: "figure", processes=2, local=True)
        return [_PLACE.sub(lambda place: drawn[int(place[1])], text) for text in texts]


def _draw(figure: Callable[[], str]) -> str:
    """Draw one figure."""
    return figure()
