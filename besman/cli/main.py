"""The command line, put together; the commands stand in files of their own.

Everything heavy is imported by its command.
"""

import atexit
import copy
import os
import sys
import threading
import warnings
from typing import Annotated, NoReturn, TextIO

# Before numpy is loaded: the matrices here are small and many.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Before MuJoCo is: windows are not opened here, and what would open them is looked for in a process
# of its own. Pictures (`besman.pictures.rendering`) ask for EGL themselves.
os.environ.setdefault("MUJOCO_GL", "disable")

import typer

from besman.cli import recordings, run, run_folders, templates, transfer
from besman.cli.annotate import annotate
from besman.cli.evaluate import evaluate_app
from besman.cli.export import export
from besman.cli.live import mirror, play
from besman.cli.look import look, markers_app
from besman.cli.plan import plan
from besman.cli.robots import robots
from besman.cli.terminal import complain
from besman.cli.view import view
from besman.exceptions import BesmanError, RecordingWarning, StoppedError
from besman.io.recordings.format import (
    parse_rate,
    parse_topics,
    parse_units,
    parse_up,
    reading,
)
from besman.work.garbage import keep_all
from besman.work.stopping import stops_on_signals

app = typer.Typer(
    name="besman",
    help="From a person's recorded movement to a robot's.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    look,
    run.run,
    run.video,
    run.report,
    run.robustness,
    run.verify,
    transfer.identify,
    run.retarget,
    recordings.train,
    recordings.segment,
    recordings.follow,
    mirror,
    play,
    view,
    annotate,
    recordings.label_markers,
    recordings.synth,
    run.check,
    run_folders.runs,
    run_folders.clean,
    run_folders.join,
    plan,
    export,
):
    app.command()(command)
app.add_typer(evaluate_app, name="evaluate")
app.add_typer(templates.app, name="template")
app.add_typer(markers_app, name="markers")
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
    strict: Annotated[
        bool, typer.Option("--strict", help="A warning about a recording is an error.")
    ] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is there of recordings that were cut.")
    ] = False,
    units: Annotated[
        str | None,
        typer.Option("--units", metavar="m|cm|mm|in|ft", help="What coordinates of files are in."),
    ] = None,
    up: Annotated[
        str | None,
        typer.Option("--up", metavar="x|y|z|-x|-y|-z", help="The axis of files that points up."),
    ] = None,
    rate: Annotated[
        str | None, typer.Option("--rate", metavar="HZ", help="Frames per second of files.")
    ] = None,
    subject: Annotated[
        str | None,
        typer.Option("--subject", metavar="NAME", help="Which of several people is taken."),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option("--topic", metavar="NAME[,NAME]", help="Which topics of bags are taken."),
    ] = None,
) -> None:
    """Options of every command; `main` takes them wherever they stand."""


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


def _take(option: str) -> bool:
    """Take an option out of the arguments, wherever it stands; tell whether it was there."""
    is_there = option in sys.argv
    sys.argv = [argument for argument in sys.argv if argument != option]
    return is_there


def _take_value(option: str) -> str | None:
    """Take an option with its value out of the arguments, wherever it stands."""
    for at, argument in enumerate(sys.argv):
        if argument.startswith(f"{option}="):
            del sys.argv[at]
            return argument.partition("=")[2]
        if argument == option and at + 1 < len(sys.argv):
            value = sys.argv[at + 1]
            del sys.argv[at : at + 2]
            return value
    return None


def _leave_others(app: typer.Typer) -> typer.Typer:
    """Return the app with only the command that is asked for: to build all takes time."""
    from typer.main import get_command_name

    asked = sys.argv[1] if len(sys.argv) > 1 else ""
    alone = copy.copy(app)
    alone.registered_commands = [
        one
        for one in app.registered_commands
        if one.callback is not None and get_command_name(one.callback.__name__) == asked
    ]
    alone.registered_groups = [one for one in app.registered_groups if one.name == asked]
    return alone if alone.registered_commands or alone.registered_groups else app


def main() -> None:
    """Run the command line; a user's error is one line and exit code 2."""
    atexit.register(keep_all)
    debug, strict, partial = _take("--debug"), _take("--strict"), _take("--partial")
    units, up, rate = _take_value("--units"), _take_value("--up"), _take_value("--rate")
    subject, topics = _take_value("--subject"), _take_value("--topic")
    warnings.showwarning = _show_warning
    try:
        with (
            warnings.catch_warnings(),
            reading(
                units=parse_units(units),
                partial=partial,
                up=parse_up(up),
                rate_hz=parse_rate(rate),
                subject=subject,
                topics=parse_topics(topics),
            ),
            stops_on_signals(_say_stopped),
        ):
            if strict:
                warnings.simplefilter("error", RecordingWarning)
            _leave_others(app)()
    except (BesmanError, RecordingWarning) as error:
        if debug:
            raise
        said = "" if isinstance(error, BesmanError) else " (--strict: a warning is an error)"
        complain("error", f"{error}{said}")
        sys.exit(2)
    except OSError as error:
        # What nobody foresaw: a disk that fails while it is read, say.
        if debug or error.filename is None:
            raise
        complain("error", f"{error.filename}: {error.strerror}")
        sys.exit(2)
    except StoppedError as error:
        _say_stopped(error)
        _leave(error.exit_code)


def _say_stopped(error: StoppedError) -> None:
    """Say what stopped it, and whether that did harm."""
    complain("", "; ".join([str(error), *getattr(error, "__notes__", ())]))


def _leave(code: int) -> NoReturn:
    """End the process, without what threads are still at."""
    others = [thread for thread in threading.enumerate() if not thread.daemon]
    if others != [threading.main_thread()]:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
