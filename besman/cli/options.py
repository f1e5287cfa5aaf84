"""Arguments and options that several commands share."""

from __future__ import annotations

import os
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


ALL_CORES = os.cpu_count() or 1


Json = Annotated[Path | None, typer.Option("--json", help="Write the result here as well.")]
