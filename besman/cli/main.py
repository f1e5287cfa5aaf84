"""The command line, put together; the commands stand in files of their own.

Everything heavy is imported by its command.
"""

from __future__ import annotations

import os
import sys
import warnings
from typing import Annotated, TextIO

# Before numpy is loaded: the matrices here are small and many.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from besman.cli import recordings, run, templates, transfer
from besman.cli.annotate import annotate
from besman.cli.evaluate import evaluate_app
from besman.cli.robots import robots
from besman.cli.terminal import complain
from besman.cli.view import view
from besman.exceptions import BesmanError, RecordingWarning

app = typer.Typer(
    name="besman",
    help="From a person's recorded movement to a robot's.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    run.run,
    run.video,
    run.report,
    run.robustness,
    run.retarget,
    recordings.train,
    recordings.segment,
    recordings.follow,
    view,
    annotate,
    recordings.label_markers,
    recordings.synth,
    run.check,
):
    app.command()(command)
app.add_typer(evaluate_app, name="evaluate")
app.add_typer(templates.app, name="template")
app.add_typer(transfer.app, name="transfer")
app.add_typer(robots, name="robots")


@app.command()
def info() -> None:
    """Print versions, for a bug report."""
    import platform

    from besman.cli.terminal import open_terminal
    from besman.work.versions import commit, library_versions

    console = open_terminal()
    for library, version in {**library_versions(), "commit": commit()}.items():
        console.print(f"{library:15} {version}")
    console.print(f"{'system':15} {platform.platform()}")


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Options of every command; `main` takes --debug wherever it stands."""


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning as one line, without the place in the source."""
    kind = "" if issubclass(category, RecordingWarning) else f"{category.__name__}: "
    complain("warning", f"{kind}{message}")


def main() -> None:
    """Run the command line; a user's error is one line and exit code 2."""
    debug = "--debug" in sys.argv
    sys.argv = [argument for argument in sys.argv if argument != "--debug"]
    warnings.showwarning = _show_warning
    try:
        app()
    except BesmanError as error:
        if debug:
            raise
        complain("error", str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        complain("", "stopped; the same command goes on from here")
        sys.exit(130)
