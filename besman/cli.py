"""The command line: commands only, no logic. Everything heavy is imported by its command."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any

# Before numpy is loaded: the matrices here are small and many.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer
from typer.core import TyperGroup

from besman.exceptions import BesmanError

app = typer.Typer(
    name="besman",
    help="From a person's recorded movement to a robot's.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Recordings = Annotated[list[Path], typer.Argument(help="Recordings, or folders of them.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; default runs/NAME.")]
Jobs = Annotated[int, typer.Option(min=1, help="Threads; never changes a result.")]
ALL_CORES = os.cpu_count() or 1
Json = Annotated[Path | None, typer.Option("--json", help="Write the result here as well.")]


def _finish(folder: Path) -> None:
    """Write and print the report of a run."""
    from rich.console import Console

    from besman.report.page import write_page
    from besman.report.terminal import print_report

    console = Console()
    page = write_page(folder)
    print_report(folder, console)
    console.print(f"report: {page}", highlight=False, soft_wrap=True)


@app.command()
def run(
    pipeline: Annotated[str, typer.Argument(help="A YAML file, or the name of a pipeline.")],
    out: Out = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE, e.g. segment.rate_hz=20.")
    ] = None,
    fresh: Annotated[str | None, typer.Option(help="Stage to compute anew.")] = None,
    jobs: Jobs = ALL_CORES,
) -> None:
    """Run a pipeline; stages whose config and input did not change are loaded."""
    from besman.pipeline import load_pipeline, run_pipeline
    from besman.resources import find_resource
    from besman.terminal import stage_display

    config = load_pipeline(find_resource("pipelines", pipeline), tuple(settings or ()))
    folder = out or Path("runs") / config.name
    with stage_display() as display:
        run_pipeline(config, folder, jobs=jobs, fresh=fresh, display=display)
    _finish(folder)


@app.command()
def report(run: Annotated[Path, typer.Argument(help="A run folder.")]) -> None:
    """Print a run's stage table and write its report.html anew."""
    _finish(run)


@app.command()
def retarget(
    run: Annotated[Path, typer.Argument(help="A finished run, whose trained model is used.")],
    recordings: Recordings,
    robot: Annotated[str | None, typer.Option(help="Another robot than the run's.")] = None,
    out: Out = None,
    jobs: Jobs = ALL_CORES,
) -> None:
    """Take new demonstrations through a run's stages, with its trained model."""
    from besman.pipeline import retarget_pipeline, run_pipeline
    from besman.terminal import stage_display

    config = retarget_pipeline(run, recordings, robot)
    folder = out or run.with_name(f"{run.name}_{config.robot}_{recordings[0].stem}")
    with stage_display() as display:
        run_pipeline(config, folder, jobs=jobs, display=display, trained_in=run)
    _finish(folder)


@app.command()
def segment(
    recordings: Recordings,
    method: Annotated[str, typer.Option(help="Segmentation method.")] = "vmci",
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    rate_hz: Annotated[float | None, typer.Option(help="Sampling rate of the method.")] = None,
    json_file: Json = None,
) -> None:
    """Find the borders of the building blocks in recordings."""
    from rich.console import Console

    from besman.run import write_json
    from besman.segment_files import segment_files, segment_table

    found = segment_files(recordings, method, markers, rate_hz)
    if json_file is not None:
        write_json(json_file, found)
    Console().print(segment_table(found))


@app.command()
def synth(
    dataset: Annotated[str, typer.Argument(help="stick_throw")],
    out: Annotated[Path, typer.Option(help="Folder to write to; must not hold other files.")],
    subjects: Annotated[int, typer.Option(min=1)] = 2,
    throws: Annotated[int, typer.Option(min=1, help="Throws of each subject.")] = 8,
    rate_hz: Annotated[float, typer.Option(min=100, max=500)] = 100.0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Write a synthetic capture with its truth: a simulated person before simulated cameras."""
    from rich.console import Console

    from besman.synthetic.datasets import write_synthetic

    paths = write_synthetic(dataset, out, subjects, throws, rate_hz, seed)
    for path in paths:
        Console().print(f"wrote {path} (synthetic)", highlight=False, soft_wrap=True)


@app.command()
def check(
    pipeline: Annotated[str, typer.Argument(help="A YAML file, or the name of a pipeline.")],
    settings: Annotated[list[str] | None, typer.Option("--set", help="KEY=VALUE.")] = None,
) -> None:
    """Say everything that can be known about a pipeline before running it."""
    from rich.console import Console

    from besman.check import check_pipeline

    console = Console()
    for line in check_pipeline(pipeline, tuple(settings or ())):
        console.print(line, highlight=False, soft_wrap=True)


class _RobotsGroup(TyperGroup):
    """What is no command of ``robots`` is the name of a robot to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put ``show`` before a name."""
        is_name = args[0] not in self.commands and not args[0].startswith("-")
        return super().resolve_command(ctx, ["show", *args] if is_name else args)


robots = typer.Typer(
    cls=_RobotsGroup, invoke_without_command=True, subcommand_metavar="[NAME | add | check]"
)
app.add_typer(robots, name="robots")


@robots.callback()
def _robots(context: typer.Context) -> None:
    """Show which robots there are, or one in full; add and check your own."""
    if context.invoked_subcommand is None:
        from rich.console import Console

        from besman.robot_tables import robots_table

        Console().print(robots_table())


@robots.command("show", hidden=True)
def _show_robot(name: Annotated[str, typer.Argument(help="A robot.")]) -> None:
    """Show a robot's limits, and where its numbers come from."""
    from rich.console import Console

    from besman.robot_tables import robot_table

    Console().print(robot_table(name))


@robots.command("add")
def _add_robot(
    urdf: Annotated[Path, typer.Argument(help="URDF of your arm.")],
    tip: Annotated[str, typer.Option(help="Link that tools are mounted on.")],
    name: Annotated[str | None, typer.Option(help="Name; default the URDF's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default beside the URDF.")] = None,
) -> None:
    """Write a robot.yaml for your own arm, and say what to look at in it."""
    from rich.console import Console

    from besman.robot.new_robot import add_robot

    path = add_robot(urdf, tip, name, out)
    Console().print(f"wrote {path}", highlight=False, soft_wrap=True)
    _print_doubts(str(path))


@robots.command("check")
def _check_robot(name: Annotated[str, typer.Argument(help="A robot, or a robot.yaml.")]) -> None:
    """Say what is missing or doubtful in a robot; exit code 1 if it cannot be used."""
    if _print_doubts(name):
        raise typer.Exit(1)


def _print_doubts(name: str) -> bool:
    """Print what is missing or doubtful; tell whether something is missing."""
    from rich.console import Console

    from besman.robot.doubts import check_robot

    console = Console()
    doubts = check_robot(name)
    for doubt in doubts:
        console.print(f"{doubt.kind:9} {doubt.text}", highlight=False, markup=False, soft_wrap=True)
    if not doubts:
        console.print("nothing is missing or doubtful")
    return any(doubt.kind == "missing" for doubt in doubts)


@app.command()
def info() -> None:
    """Print versions, for a bug report."""
    import platform

    from rich.console import Console

    from besman.run import commit, library_versions

    console = Console()
    for library, version in {**library_versions(), "commit": commit()}.items():
        console.print(f"{library:15} {version}", highlight=False)
    console.print(f"{'system':15} {platform.platform()}", highlight=False)


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Options of every command; `main` takes --debug wherever it stands."""


def main() -> None:
    """Run the command line; a user's error is one line and exit code 2."""
    debug = "--debug" in sys.argv
    sys.argv = [argument for argument in sys.argv if argument != "--debug"]
    try:
        app()
    except BesmanError as error:
        if debug:
            raise
        print(f"besman: error: {error}", file=sys.stderr)  # noqa: T201
        sys.exit(2)
    except KeyboardInterrupt:
        print("besman: stopped; the same command goes on from here", file=sys.stderr)  # noqa: T201
        sys.exit(130)
