"""Progress bars for stages, on a terminal; silent where there is none."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from besman.work.display import Display


@contextmanager
def stage_display() -> Iterator[Display]:
    """Show a progress bar for every stage that is being computed; none of one that is refused.

    Yields
    ------
    callable
        A `besman.work.display.Display`.
    """
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
