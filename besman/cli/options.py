"""Arguments and options that several commands share."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from besman.io.recordings.formats import KNOWN_FORMATS

Recordings = Annotated[
    list[Path], typer.Argument(help=f"Recordings, or folders of them: {KNOWN_FORMATS}.")
]


Out = Annotated[Path | None, typer.Option(help="Run folder; default runs/NAME.")]


Jobs = Annotated[int, typer.Option(min=1, help="Threads or processes; never changes a result.")]


Cluster = Annotated[
    str | None,
    typer.Option(help="Dask scheduler, tcp://HOST:PORT, whose workers map and refine."),
]


ToolName = Annotated[
    str | None, typer.Option("--tool", help="A tool of the robot, or of tools/.", metavar="NAME")
]


ALL_CORES = os.cpu_count() or 1


def _before_the_work(check: str) -> Callable[[typer.CallbackParam, Path | None], Path | None]:
    """Return what refuses a path that could not be written to after the work."""

    def look(parameter: typer.CallbackParam, path: Path | None) -> Path | None:
        if path is not None:
            from besman.io import atomic_files

            getattr(atomic_files, check)(path, f"{parameter.opts[-1]}: {path}")
        return path

    return look


target_file = _before_the_work("check_file")
target_folder = _before_the_work("check_folder")


Json = Annotated[
    Path | None,
    typer.Option("--json", help="Write the result here as well.", callback=target_file),
]


Figures = Annotated[Path | None, typer.Option(help="Folder for figures.", callback=target_folder)]
