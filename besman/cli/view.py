"""The command ``besman view``. Everything heavy is imported by it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from besman.cli.terminal import say

if TYPE_CHECKING:
    from besman.view.run_content import RunContent


def view(
    run: Annotated[Path, typer.Argument(help="A finished run.")],
    motion: Annotated[
        str | None, typer.Option(help="Name of a motion to begin with; of a file, the only one.")
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(help="HTML to write: the same as one file. RUN/replay.html: report links it."),
    ] = None,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Of the page; a free one if not given.")
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address alone.")
    ] = False,
) -> None:
    """Show person and robot side by side in the browser, or write that as one HTML file."""
    from besman.view.run_content import RunContent

    content = RunContent(run)
    if export is not None:
        _export(content, run, motion, export)
        return
    from besman.view.live import open_view

    server = open_view(content, motion, port)
    say(f"{run}: {server.url}")
    say("The page is there until Ctrl+C.")
    server.serve(browser=not no_browser)


def _export(content: "RunContent", run: Path, motion: str | None, out: Path) -> None:
    """Write the file and say what is in it."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.pipeline.derived_files import note_file
    from besman.report.page import write_page
    from besman.view.export import write_replay

    with stage_display() as display:
        progress, end = display("replay")
        shown, total = write_replay(content, out, motion, progress=progress)
        end(True)
    note_file(run, out)
    if out.resolve() == (run / "replay.html").resolve():
        write_page(run)
    size = out.stat().st_size / 1e6
    console = open_terminal()
    console.print(
        f"wrote {out}: {shown} of {total} demonstrations, {size:.2f} MB",
        soft_wrap=True,
    )
