"""The command line: commands only, no logic. Everything heavy is imported by its command."""

from __future__ import annotations

import os
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, TextIO

# Before numpy is loaded: the matrices here are small and many.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer
from typer.core import TyperGroup

from besman.annotate.commands import annotate
from besman.exceptions import BesmanError, RecordingWarning
from besman.templates import commands as templates
from besman.transfer import commands as transfer
from besman.view.commands import view

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
Jobs = Annotated[int, typer.Option(min=1, help="Threads or processes; never changes a result.")]
Cluster = Annotated[
    str | None,
    typer.Option(help="Dask scheduler, tcp://HOST:PORT, whose workers map and refine."),
]
ALL_CORES = os.cpu_count() or 1
# Datasets are heavy to import for a help text; a test compares.
_DATASETS = (
    "step, lever, pick_and_place, ball_throw, stick_throw, stick_throw_unmarked (no stick seen), "
    "stick_throw_marked (small), gestures, object_rotation, circle_drawing, rotation"
)
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
        list[str] | None, typer.Option("--set", help="KEY=VALUE, e.g. select.label=throw.")
    ] = None,
    fresh: Annotated[str | None, typer.Option(help="Stage to compute anew.")] = None,
    jobs: Jobs = ALL_CORES,
    cluster: Cluster = None,
    video: Annotated[bool, typer.Option("--video", help="Make the video of a motion too.")] = False,
) -> None:
    """Run a pipeline; stages whose config and input did not change are loaded."""
    from besman.pipeline import load_pipeline, run_pipeline
    from besman.resources import find_resource
    from besman.terminal import stage_display

    config = load_pipeline(find_resource("pipelines", pipeline), tuple(settings or ()))
    folder = out or Path("runs") / config.name
    if video:
        from besman.report.video import check_video

        check_video()
    with stage_display() as display:
        run_pipeline(config, folder, jobs=jobs, cluster=cluster, fresh=fresh, display=display)
    if video:
        _make_video(folder)
    _finish(folder)


def _make_video(
    folder: Path, motion: str | None = None, out: Path | None = None, second_arm: bool = False
) -> Path:
    """Make the video of a motion of a run, with its progress shown."""
    from besman.report.video import write_video
    from besman.terminal import stage_display

    with stage_display() as display:
        progress, end = display("video")
        path = write_video(folder, motion, out, second_arm=second_arm, progress=progress)
        end(True)
    return path


@app.command()
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
    from rich.console import Console

    from besman.report.page import write_page

    path = _make_video(run, motion, out, second_arm)
    write_page(run)
    Console().print(f"wrote {path}", highlight=False, soft_wrap=True)


@app.command()
def report(run: Annotated[Path, typer.Argument(help="A run folder.")]) -> None:
    """Print a run's stage table and write its report.html anew."""
    _finish(run)


@app.command()
def robustness(
    run: Annotated[Path, typer.Argument(help="A finished run.")],
    models: Annotated[int, typer.Option(min=0, help="Perturbed models.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the perturbations.")] = 0,
    jobs: Jobs = ALL_CORES,
    json_file: Json = None,
) -> None:
    """Try a run's refined motions in perturbed models and at a quarter of the time step."""
    from rich.console import Console

    from besman.refinement.robustness import RobustnessConfig
    from besman.report.robustness import robustness_table
    from besman.report.terminal import robustness_line
    from besman.robustness_check import check_robustness
    from besman.run import write_json
    from besman.terminal import stage_display
    from besman.work import Work

    with stage_display() as display:
        progress, end = display("robustness")
        config = RobustnessConfig(models=models, seed=seed)
        found, results = check_robustness(run, config, Work(jobs, progress))
        end(True)
    if json_file is not None:
        write_json(json_file, results)
    console = Console()
    console.print(robustness_table(found))
    console.print(robustness_line(results), highlight=False, soft_wrap=True)


@app.command()
def retarget(
    run: Annotated[Path, typer.Argument(help="A finished run, whose trained model is used.")],
    recordings: Recordings,
    robots: Annotated[
        list[str] | None,
        typer.Option("--robot", help="Another robot than the run's; may be given several times."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder, of several robots the folder of their run folders."),
    ] = None,
    jobs: Jobs = ALL_CORES,
    cluster: Cluster = None,
) -> None:
    """Take new demonstrations through a run's stages, with its trained model."""
    from rich.console import Console

    from besman.report.robots import robots_table
    from besman.retargeting import plan_retargeting, raise_failures, retarget_robots
    from besman.terminal import stage_display

    plans = plan_retargeting(run, recordings, tuple(robots or ()), out)
    with stage_display() as display:
        done = retarget_robots(plans, run, jobs=jobs, cluster=cluster, display=display)
    if len(done) == 1 and done[0].error is None:
        _finish(done[0].plan.folder)
    elif len(done) > 1:
        console = Console()
        console.print(robots_table(done))
        for one in done:
            console.print(f"{one.plan.name}: {one.plan.folder}", highlight=False, soft_wrap=True)
    raise_failures(done)


@app.command()
def train(
    segments: Annotated[
        list[Path],
        typer.Argument(help="Recordings with segments files beside them, or those, or folders."),
    ],
    out: Annotated[Path, typer.Option(help="Model to write: NAME.npz and NAME.json.")],
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE of recognize, e.g. method=hmm."),
    ] = None,
) -> None:
    """Learn to name segments; a pipeline uses the model with recognize: {model: PATH}."""
    from rich.console import Console

    from besman.check import list_counts
    from besman.recognition.model_files import load_model
    from besman.training import train_files

    written = train_files(segments, out, markers, tuple(settings or ()))
    counts = list_counts(Counter(load_model(written[0]).labels))
    lines = [f"learnt {counts}", *(f"wrote {path}" for path in written)]
    Console().print("\n".join(lines), highlight=False, soft_wrap=True)


@app.command()
def segment(
    recordings: Recordings,
    method: Annotated[str, typer.Option(help="Segmentation method.")] = "valley_vmci",
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    rate_hz: Annotated[
        float | None, typer.Option(help="Sampling rate of a method that has one.")
    ] = None,
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
def follow(
    recording: Annotated[Path, typer.Argument(help="A recording, replayed as a stream.")],
    run: Annotated[Path | None, typer.Option(help="A run, whose trained models are used.")] = None,
    models: Annotated[
        list[Path] | None,
        typer.Option("--model", help="A model of besman train; one for each arm."),
    ] = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set; default the run's, or right_arm.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="1 for real time; default as fast as can be.")
    ] = None,
    horizon: Annotated[
        int, typer.Option(min=0, help="Blocks after which an action is final; 0: at the end.")
    ] = 20,
    steady: Annotated[
        float, typer.Option(min=0, help="Seconds that a border must hold to be shown.")
    ] = 0.2,
    calibration: Annotated[
        float | None,
        typer.Option(help="Scale by the first seconds; default by the run's recordings, or 10."),
    ] = None,
    json_file: Json = None,
) -> None:
    """Keep blocks and actions current sample by sample; print what changes."""
    from besman.following.files import Replay, describe_change
    from besman.following.plans import make_plan
    from besman.run import write_json

    plan = make_plan(run, models or [], markers, calibration)
    replay = Replay(recording, plan, speed, horizon or None, steady)
    for at, change in replay.run():
        typer.echo(describe_change(at, change, replay.recording.rate_hz))
    if json_file is not None:
        write_json(json_file, replay.content())
    typer.echo(replay.summary())


evaluate_app = typer.Typer(
    help="Measure a table of the thesis on given data.", no_args_is_help=True
)
app.add_typer(evaluate_app, name="evaluate")
app.add_typer(templates.app, name="template")
app.add_typer(transfer.app, name="transfer")
app.command()(view)
app.command()(annotate)


@evaluate_app.command("segmentation")
def evaluate_segmentation(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with manual segments; simulated data if not given."
        ),
    ] = None,
    methods: Annotated[
        str | None, typer.Option(help="Methods, separated by commas; all if not given.")
    ] = None,
    margin_s: Annotated[
        float | None, typer.Option(help="Greatest distance of a border found; the thesis' if not.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated data and bootstrap.")] = 0,
    synthetic: Annotated[
        bool, typer.Option("--synthetic", help="The recordings in the folder are simulated.")
    ] = False,
    json_file: Json = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for figures of the recordings.")
    ] = None,
) -> None:
    """Compare segmentation methods (tables 4.1 to 4.4)."""
    from rich.console import Console

    from besman.evaluation import segmentation as experiment
    from besman.evaluation.segmentation_tables import segmentation_tables
    from besman.run import write_json
    from besman.terminal import stage_display

    chosen = None if methods is None else [name.strip() for name in methods.split(",")]
    with stage_display() as display:
        progress, end = display("evaluate")
        result = experiment.evaluate_segmentation(
            data,
            chosen,
            margin_s,
            seed,
            figures,
            "synthetic" if synthetic else "real",
            progress,
        )
        end(True)
    if json_file is not None:
        write_json(json_file, result)
    console = Console()
    for table in segmentation_tables(result["rows"]):
        console.print(table)


@app.command()
def label_markers(
    recording: Annotated[Path, typer.Argument(help="A recording without names.")],
    out: Annotated[Path, typer.Option(help="File to write, .tsv or .c3d.")],
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    learn_from: Annotated[
        Path | None, typer.Option(help="A recording with names, to learn distances from.")
    ] = None,
    fill: Annotated[bool, typer.Option("--fill", help="Fill short gaps.")] = False,
    figure: Annotated[Path | None, typer.Option(help="Draw a time line, .png or .svg.")] = None,
    json_file: Json = None,
) -> None:
    """Name the unnamed trajectories of a recording; what is not sure stays unnamed."""
    from rich.console import Console

    from besman.label_files import draw_names, label_file, summarise, summary_tables
    from besman.run import write_json

    read, named = label_file(recording, markers, out, learn_from, fill)
    summary = summarise(read, named)
    if json_file is not None:
        write_json(json_file, summary)
    if figure is not None:
        draw_names(named, figure)
    console = Console()
    for table in summary_tables(summary):
        console.print(table)
    console.print(f"wrote {out}", highlight=False, soft_wrap=True)


@evaluate_app.command("labelling")
def evaluate_labelling(
    data: Annotated[
        Path | None, typer.Option(help="Folder of recordings; default the embedded sample.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Repetitions of what is random.")] = 2,
    json_file: Json = None,
) -> None:
    """Measure how well unnamed trajectories get their names, beside a plain tracker."""
    from rich.console import Console

    from besman.evaluation import labelling
    from besman.run import write_json
    from besman.terminal import stage_display

    with stage_display() as display:
        progress, end = display("evaluate")
        result = labelling.evaluate_labelling(data, seeds, progress)
        end(True)
    if json_file is not None:
        write_json(json_file, result)
    Console().print(labelling.labelling_table(result["rows"]))


@app.command()
def synth(
    dataset: Annotated[str, typer.Argument(help=f"One of {_DATASETS}.")],
    out: Annotated[Path, typer.Option(help="Folder to write to; no file in it is overwritten.")],
    subjects: Annotated[
        int | None, typer.Option(min=1, help="How many; as in the thesis by default.")
    ] = None,
    repetitions: Annotated[
        int | None, typer.Option(min=1, help="Of each subject; as in the thesis by default.")
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(min=60, max=500, help="Frames per second; the dataset's if not.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of people and their movements.")] = 0,
    unlabelled: Annotated[
        bool, typer.Option("--unlabelled", help="Unnamed trajectories with gaps and ghosts.")
    ] = False,
) -> None:
    """Write synthetic captures with their truth: simulated people before simulated cameras."""
    from rich.console import Console

    from besman.synthetic.cameras import Room
    from besman.synthetic.datasets import write_synthetic
    from besman.terminal import stage_display

    room = Room() if unlabelled else None
    with stage_display() as display:
        progress, end = display(f"synth {dataset}")
        paths = write_synthetic(dataset, out, subjects, repetitions, rate_hz, seed, room, progress)
        end(True)
    for path in paths:
        Console().print(f"wrote {path} (synthetic)", highlight=False, soft_wrap=True)


@evaluate_app.command("recognition")
def evaluate_recognition(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with segments, or of such folders; if not given, simulated "
            "datasets of the size they have in the thesis."
        ),
    ] = None,
    datasets: Annotated[
        list[str] | None,
        typer.Option("--dataset", help="Simulated dataset, e.g. gestures; all if not given."),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option("--method", help="nearest_neighbour, dtw, hmm, lstm; default all there are."),
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Random choices of examples.")] = 100,
    figures: Annotated[Path | None, typer.Option(help="Folder for figures.")] = None,
    json_file: Json = None,
) -> None:
    """Accuracy over examples, settings and new subjects: figures 5.3 and 5.5 to 5.8."""
    from rich.console import Console

    from besman.evaluation.recognition import check_methods, recognition_table, run_recognition
    from besman.evaluation.recognition_data import load_sets, simulate_sets
    from besman.exceptions import ConfigError
    from besman.run import write_json
    from besman.terminal import stage_display

    chosen = check_methods(methods)
    if data is not None and datasets:
        raise ConfigError("--data and --dataset: got both; expected one of them")
    with stage_display() as display:
        if data is None:
            progress, end = display("simulate")
            sets = simulate_sets(datasets, progress=progress)
            end(True)
        else:
            sets = load_sets(data)
        progress, end = display("recognition")
        result = run_recognition(sets, chosen, draws, progress)
        end(True)
    if json_file is not None:
        write_json(json_file, result)
    console = Console()
    console.print(recognition_table(result))
    if figures is not None:
        from besman.evaluation.recognition_figures import write_figures

        for path in write_figures(result, sets, figures):
            console.print(f"wrote {path}", highlight=False, soft_wrap=True)


@evaluate_app.command("mapping")
def evaluate_mapping(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with segments, or of such folders: every labelled class; if "
            "not given, simulated stick throws, as many as in the thesis."
        ),
    ] = None,
    robots: Annotated[
        list[str] | None,
        typer.Option("--robot", help="Robot, or a robot.yaml; default ur5, ur10, iiwa7, compi."),
    ] = None,
    subjects: Annotated[int | None, typer.Option(min=1, help="Of simulated throws.")] = None,
    repetitions: Annotated[
        int | None, typer.Option(min=1, help="Simulated throws of each subject.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated throws.")] = 0,
    jobs: Jobs = ALL_CORES,
    figures: Annotated[Path | None, typer.Option(help="Folder for figures.")] = None,
    json_file: Json = None,
) -> None:
    """Demonstrations in the workspaces of several arms, as in section 7.2.3 and figure 7.5."""
    from rich.console import Console

    from besman.evaluation import mapping
    from besman.evaluation.mapping_data import choose_sets
    from besman.evaluation.mapping_tables import failure_lines, mapping_tables
    from besman.run import write_json
    from besman.terminal import stage_display
    from besman.work import Work
    from besman.workers import Workers

    with stage_display() as display, Workers(jobs) as workers:
        progress, end = display("demos")
        sets = choose_sets(data, subjects, repetitions, seed, progress)
        end(True)
        progress, end = display("mapping")
        work = Work(jobs, progress, workers=workers)
        result, mapped = mapping.evaluate_mapping(sets, robots or mapping.ROBOTS, work=work)
        end(True)
    if json_file is not None:
        write_json(json_file, result)
    console = Console()
    for table in mapping_tables(result["rows"]):
        console.print(table)
    for line in failure_lines(result["rows"]):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if figures is not None:
        from besman.evaluation.mapping_figures import write_figures

        for path in write_figures(mapped, figures):
            console.print(f"wrote {path}", highlight=False, soft_wrap=True)


@evaluate_app.command("refinement")
def evaluate_refinement(
    problems: Annotated[
        list[str] | None,
        typer.Option(
            "--problem",
            help="sphere, rosenbrock, contextual_sphere, contextual_rosenbrock, via_points, "
            "via_points_joint, obstacles, obstacles_joint; stick_throw, ball_throw, grasp_box, "
            "pull_lever; or a pipeline.yaml, whose imitations are refined.",
        ),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--method", help="cma_es, reps, pi2, pi2_cma, cem; c_reps, c_cma_es; default all."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of every search.")] = 5,
    first_seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 0,
    jobs: Jobs = ALL_CORES,
    figures: Annotated[Path | None, typer.Option(help="Folder for learning curves.")] = None,
    json_file: Json = None,
) -> None:
    """Compare searches on functions with public figures and on simulated tasks."""
    from rich.console import Console

    from besman.evaluation import refinement
    from besman.evaluation.refinement_problems import load_problem
    from besman.evaluation.refinement_tables import refinement_tables, write_curves
    from besman.run import write_json
    from besman.terminal import stage_display
    from besman.work import Work
    from besman.workers import Workers

    with stage_display() as display, Workers(jobs) as workers:
        chosen = [load_problem(name) for name in problems or refinement.PROBLEMS]
        progress, end = display("refinement")
        work = Work(jobs, progress, workers=workers)
        runs = range(first_seed, first_seed + seeds)
        result = refinement.evaluate_refinement(chosen, methods, runs, work)
        end(True)
    if json_file is not None:
        write_json(json_file, result)
    console = Console()
    for table in refinement_tables(result["rows"]):
        console.print(table)
    if figures is not None:
        for path in write_curves(result["rows"], figures):
            console.print(f"wrote {path}", highlight=False, soft_wrap=True)


@evaluate_app.command("hierarchy")
def evaluate_hierarchy(
    datasets: Annotated[
        list[str] | None, typer.Argument(help="step, object_rotation, circle_drawing, rotation.")
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Draws of examples to learn from.")] = 10,
    json_file: Json = None,
) -> None:
    """Blocks and actions: tables 6.1 and 6.2 and section 8.2, on simulated captures."""
    from rich.console import Console

    from besman.evaluation.hierarchy import EXPERIMENTS, hierarchy_table, run_experiment
    from besman.run import write_json
    from besman.terminal import stage_display

    rows = []
    with stage_display() as display:
        for name in datasets or EXPERIMENTS:
            progress, end = display(name)
            rows += run_experiment(name, draws=draws, progress=progress)
            end(True)
    if json_file is not None:
        write_json(json_file, {"experiment": "hierarchy", "rows": rows})
    Console().print(hierarchy_table(rows))


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

    from besman.versions import commit, library_versions

    console = Console()
    for library, version in {**library_versions(), "commit": commit()}.items():
        console.print(f"{library:15} {version}", highlight=False)
    console.print(f"{'system':15} {platform.platform()}", highlight=False)


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
    print(f"besman: warning: {kind}{message}", file=sys.stderr)  # noqa: T201


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
        print(f"besman: error: {error}", file=sys.stderr)  # noqa: T201
        sys.exit(2)
    except KeyboardInterrupt:
        print("besman: stopped; the same command goes on from here", file=sys.stderr)  # noqa: T201
        sys.exit(130)
