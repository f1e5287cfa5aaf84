"""What is shown of stages that are being computed: bars on a terminal, elsewhere lines."""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from besman.exceptions import one_line
from besman.work.display import Display

_EVERY_S = 10.0


@contextmanager
def stage_display() -> Iterator[Display]:
    """Show how far every stage is that is being computed, on the standard error.

    Where that is no terminal (a file, a log, a notebook): a line as a stage begins, one as it ends,
    and one every ten seconds between. On a terminal: bars, none of a stage that is refused.

    Yields
    ------
    callable
        A `besman.work.display.Display`.
    """
    if _is_terminal():
        with _bars() as show:
            yield show
        return
    told: list[StageLines] = []

    def tell(name: str) -> tuple[Callable[[float], None], Callable[[bool], None]]:
        told.append(StageLines(name, _print))
        return told[-1].progress, told[-1].end

    try:
        yield tell
    finally:
        for one in told:
            one.stop()


def _is_terminal() -> bool:
    """Tell whether somebody looks at the standard error, as Rich does, which takes time to load."""
    # Rich takes a wish for colours for a terminal.
    return bool(os.environ.get("FORCE_COLOR")) or (sys.stderr is not None and sys.stderr.isatty())


@contextmanager
def _bars() -> Iterator[Display]:
    """Show a progress bar for every stage."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from besman.cli.terminal import open_terminal

    progress = Progress(
        TextColumn("{task.description:>10}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        console=open_terminal(stderr=True),
        transient=False,
    )

    def show(name: str) -> tuple[Callable[[float], None], Callable[[bool], None]]:
        task = progress.add_task(name, total=1.0)

        def end(ok: bool) -> None:
            progress.update(task, completed=1.0 if ok else None)
            progress.stop_task(task)

        return (lambda done: progress.update(task, completed=done)), end

    with progress:
        try:
            yield show
        except BaseException:
            # Of what had not begun an error's line says more than its bar.
            for task in progress.task_ids:
                if progress.tasks[task].completed == 0:
                    progress.update(task, visible=False)
            raise


class StageLines:
    """Lines about one stage: as it begins, every so often, and as it ends.

    Parameters
    ----------
    name : str
        Of the stage.
    tell : callable
        Takes a line, from another thread too.
    every_s : float
        How long until the next line, seconds.
    """

    def __init__(self, name: str, tell: Callable[[str], None], every_s: float = _EVERY_S) -> None:
        self._name, self._tell, self._every_s = name, tell, every_s
        self._share, self._begun = 0.0, time.monotonic()
        self._over = threading.Event()
        tell(f"{name} ...")
        threading.Thread(target=self._go_on, daemon=True).start()

    def progress(self, share: float) -> None:
        """Take how far it is, 0 to 1."""
        self._share = share

    def end(self, ok: bool) -> None:
        """Say how long it took."""
        if not self._over.is_set():
            spent = time.monotonic() - self._begun
            self._tell(f"{self._name}: {spent:.1f} s" if ok else f"{self._name}: not finished")
        self.stop()

    def stop(self) -> None:
        """Say no more."""
        self._over.set()

    def _go_on(self) -> None:
        while not self._over.wait(self._every_s):
            spent = time.monotonic() - self._begun
            self._tell(f"{self._name}: {100 * self._share:.0f} %, {spent:.0f} s")


def _print(line: str) -> None:
    """Print a line at once; nobody may be there any more who reads it."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(f"{one_line(line)}\n")
        sys.stderr.flush()
