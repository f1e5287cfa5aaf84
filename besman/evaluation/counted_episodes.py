"""How far attempts are that take minutes each, in this process or another one of this machine."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

_EVERY_S = 0.5


def add_episodes(file: Path, n: int) -> None:
    """Say that so many more episodes are done: the file has a byte for each."""
    with file.open("ab") as stream:
        stream.write(b"." * n)


@contextmanager
def watched_episodes(
    budgets: Sequence[int], progress: Callable[[float], None], every_s: float = _EVERY_S
) -> Iterator[list[Path]]:
    """Tell twice a second how many episodes of all attempts are done.

    Parameters
    ----------
    budgets : sequence of int
        Episodes of every attempt; one that is over has had all of them.
    progress : callable
        Called with the share done, 0 to 1, from another thread.
    every_s : float
        How often.

    Yields
    ------
    list of Path
        For every attempt the file that `add_episodes` adds to.
    """
    over = Event()
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{at}" for at in range(len(budgets))]

        def watch() -> None:
            while not over.wait(every_s):
                progress(share_done(files, budgets))

        thread = Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield files
        finally:
            over.set()
            thread.join()


def share_done(files: Sequence[Path], budgets: Sequence[int]) -> float:
    """Return the share of all attempts that is done, each counted alike."""
    done = [
        min(file.stat().st_size / budget, 1.0) if file.exists() else 0.0
        for file, budget in zip(files, budgets, strict=True)
    ]
    return sum(done) / max(len(done), 1)
