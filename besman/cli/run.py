"""Commands about runs: run, report, video, robustness, verify, retarget, check."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from besman.cli.options import ALL_CORES, Cluster, Jobs, Json, Out, Recordings, ToolName
from besman.cli.run_folders import say_check
from besman.exceptions import ConfigError
from besman.work.garbage import keep_all

if TYPE_CHECKING:
    from besman.work.workers import Workers


def _finish(folder: Path, workers: "Workers | None" = None) -> None:
    """Write and print the report of a run."""
    from besman.cli.terminal import open_terminal
    from besman.report.page import write_page
    from besman.report.terminal import print_report
    from besman.work.work import Work

    console = open_terminal()
    page = write_page(folder, Work(workers.jobs if workers else 1, workers=workers))
    print_report(folder, console)
    console.print(f"report: {page}", soft_wrap=True)


def run(
    pipeline: Annotated[str, typer.Argument(help="A YAML file, or the name of a pipeline.")],
    out: Out = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE, e.g. select.label=throw.")
    ] = None,
    tool: ToolName = None,
    fresh: Annotated[str | None, typer.Option(help="Stage to compute anew.")] = None,
    jobs: Jobs = ALL_CORES,
    cluster: Cluster = None,
    video: Annotated[bool, typer.Option("--video", help="Make the video of a motion too.")] = False,
) -> None:
    """Run a pipeline; stages whose config and input did not change are loaded."""
    from besman.config.resources import find_resource

    path = find_resource("pipelines", pipeline)
    _load_ahead(path, out, jobs, cluster)
    from besman.cli.progress_bars import stage_display
    from besman.pipeline.config import load_pipeline

    chosen = [*(settings or ()), *([] if tool is None else [f"tool={tool}"])]
    config = load_pipeline(path, tuple(chosen))
    folder = out or Path("runs") / config.name
    if video:
        from besman.report.video import check_video

        check_video()
    with _workers(jobs, cluster) as workers:
        from besman.pipeline.pipeline import run_pipeline

        keep_all()
        with stage_display() as display:
            run_pipeline(config, folder, jobs=jobs, fresh=fresh, display=display, workers=workers)
        if video:
            _make_video(folder)
        _finish(folder, workers)


def _load_ahead(pipeline: Path, out: Path | None, jobs: int, cluster: str | None) -> None:
    """Have what the processes of a new run need loaded, while this one loads what it needs itself.

    Where the pipeline is not named as its file is, that begins when the first process is needed.
    """
    folder = out or Path("runs") / pipeline.stem
    if jobs > 1 and cluster is None and not folder.exists():
        from besman.pipeline.preload import PRELOAD
        from besman.report.preload import DRAWING
        from besman.work.fork_server import start_server

        start_server((*PRELOAD, *DRAWING))


def _workers(jobs: int, cluster: str | None) -> "Workers":
    """Return the processes of a run."""
    from besman.pipeline.preload import PRELOAD
    from besman.report.preload import DRAWING
    from besman.work.workers import Workers

    return Workers(jobs, cluster, (*PRELOAD, *DRAWING))


def _make_video(
    folder: Path, motion: str | None = None, out: Path | None = None, second_arm: bool = False
) -> Path:
    """Make the video of a motion of a run, with its progress shown."""
    from besman.cli.progress_bars import stage_display
    from besman.report.video import write_video

    with stage_display() as display:
        progress, end = display("video")
        path = write_video(folder, motion, out, second_arm=second_arm, progress=progress)
        end(True)
    return path


def video(
    run: Annotated[Path, typer.Argument(help="A run folder.")],
    motion: Annotated[
        str | None, typer.Option(help="Name of a motion; one that shows much if not given.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="MP4 to write; default in the run.")] = None,
    second_arm: Annotated[
        bool, typer.Option("--second-arm", help="Of the other of two arms.")
    ] = False,
) -> None:
    """Make a video of a motion: imitated, on the way, and refined, side by side."""
    from besman.cli.terminal import open_terminal
    from besman.report.page import write_page

    path = _make_video(run, motion, out, second_arm)
    write_page(run)
    open_terminal().print(f"wrote {path}", soft_wrap=True)


def report(run: Annotated[Path, typer.Argument(help="A run folder.")]) -> None:
    """Print a run's stage table and write its report.html anew."""
    _finish(run)


def robustness(
    run: Annotated[Path, typer.Argument(help="A finished run.")],
    models: Annotated[int, typer.Option(min=0, help="Perturbed models.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the perturbations.")] = 0,
    jobs: Jobs = ALL_CORES,
    json_file: Json = None,
) -> None:
    """Try a run's refined motions in perturbed models and at a quarter of the time step."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.io.atomic_files import write_json
    from besman.pipeline.robustness_of_run import check_robustness
    from besman.report.robustness import robustness_table
    from besman.report.terminal import robustness_line
    from besman.stages.refine.robustness import RobustnessConfig
    from besman.work.work import Work

    with stage_display() as display:
        progress, end = display("robustness")
        config = RobustnessConfig(models=models, seed=seed)
        found, results = check_robustness(run, config, Work(jobs, progress))
        end(True)
    console = open_terminal()
    console.print(robustness_table(found))
    console.print(robustness_line(results), soft_wrap=True)
    if json_file is not None:
        write_json(json_file, results)


def verify(
    run: Annotated[Path, typer.Argument(help="A finished run of throws, or of a lever.")],
    engine: Annotated[str, typer.Option(metavar="drake", help="Which engine.")] = "drake",
    jobs: Jobs = ALL_CORES,
    json_file: Json = None,
) -> None:
    """Try a run's refined motions in a second physics engine, beside MuJoCo."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.io.atomic_files import write_json
    from besman.pipeline.verification_file import VERIFIED
    from besman.pipeline.verified_run import verify_run
    from besman.report.page import write_page
    from besman.report.verification import verification_lines, verification_table
    from besman.work.work import Work
    from besman.work.workers import Workers

    with stage_display() as display, Workers(jobs) as workers:
        progress, end = display("verify")
        _, results = verify_run(run, engine, Work(jobs, progress, workers=workers))
        end(True)
    console = open_terminal()
    console.print(verification_table(results))
    for line in verification_lines(results):
        console.print(line, soft_wrap=True)
    page = write_page(run)
    console.print(f"wrote {run / VERIFIED}", soft_wrap=True)
    console.print(f"report: {page}", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, results)


def retarget(
    run: Annotated[Path, typer.Argument(help="A finished run, whose trained model is used.")],
    recordings: Recordings,
    robots: Annotated[
        list[str] | None,
        typer.Option("--robot", help="Another robot than the run's; may be given several times."),
    ] = None,
    tool: ToolName = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder, of several robots the folder of their run folders."),
    ] = None,
    jobs: Jobs = ALL_CORES,
    cluster: Cluster = None,
) -> None:
    """Take new demonstrations through a run's stages, with its trained model."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.pipeline.retarget import plan_retargeting, raise_failures, retarget_robots
    from besman.report.page import write_page
    from besman.report.robots import retargeted_table

    plans = plan_retargeting(run, recordings, tuple(robots or ()), out, tool)
    with stage_display() as display:
        done = retarget_robots(plans, run, jobs=jobs, cluster=cluster, display=display)
    if len(done) == 1 and done[0].error is None:
        _finish(done[0].plan.folder)
    elif len(done) > 1:
        console = open_terminal()
        console.print(retargeted_table(done))
        for one in done:
            if one.error is None:
                write_page(one.plan.folder)
            console.print(f"{one.plan.name}: {one.plan.folder}", soft_wrap=True)
    raise_failures(done)


def check(
    pipeline: Annotated[
        str, typer.Argument(help="A YAML file, the name of a pipeline, or a run folder.")
    ],
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE of a pipeline.")
    ] = None,
) -> None:
    """Say everything that can be known about a pipeline before running it.

    Of a run folder, say what is missing, cut or foreign in it; exit code 1 if something is.
    """
    from besman.cli.terminal import open_terminal

    if (Path(pipeline) / "run.json").exists():
        if settings:
            raise ConfigError(f"--set: {pipeline} is a run folder, which takes no settings")
        say_check(Path(pipeline))
        return
    from besman.pipeline.check import check_pipeline

    console = open_terminal()
    for line in check_pipeline(pipeline, tuple(settings or ())):
        console.print(line, soft_wrap=True)
