"""How progress is shown."""

from __future__ import annotations

from collections.abc import Callable

# Called with the stage's name; returns the progress callback and a function that ends the display.
Display = Callable[[str], tuple[Callable[[float], None], Callable[[bool], None]]]


def no_display(name: str) -> tuple[Callable[[float], None], Callable[[bool], None]]:
    """Show nothing.

    Parameters
    ----------
    name : str
        Of what is done.
    """
    return (lambda share: None), (lambda ok: None)
