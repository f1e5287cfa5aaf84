"""The command that writes a run for other tools: export."""

from pathlib import Path
from typing import Annotated

import typer

from besman.cli.terminal import say


def export(
    run: Annotated[Path, typer.Argument(help="A finished run.")],
    kind: Annotated[
        str,
        typer.Option("--to", metavar="mcap|bag|lerobot", help="Log for Foxglove, or dataset."),
    ],
    out: Annotated[
        Path | None, typer.Option(help="File, or new folder; default beside the run.")
    ] = None,
) -> None:
    """Write a run as a log (MCAP, rosbag2) or as a dataset of LeRobot."""
    from besman.pipeline.run_log import export_run

    path, summary = export_run(run, kind, out)
    size = sum(file.stat().st_size for file in (path, *path.rglob("*")) if file.is_file())
    say(f"wrote {path}: {summary}, {size / 1e6:.2f} MB")
