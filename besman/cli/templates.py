"""The commands of ``besman template``. Everything heavy is imported by its command."""

import os
from pathlib import Path
from typing import Annotated

import typer

from besman.cli.options import target_file
from besman.exceptions import one_of
from besman.search.kinds import CONTEXTUAL_NAMES

app = typer.Typer(help="Motions for targets that were never tried.", no_args_is_help=True)

RunFolder = Annotated[Path, typer.Argument(help="A finished run.")]


@app.command("learn")
def learn(
    run: RunFolder,
    context: Annotated[
        str | None, typer.Option(help="Coordinates of the context, e.g. x,y; default x,y.")
    ] = None,
    region: Annotated[
        str | None,
        typer.Option(
            help="LEAST:GREATEST of each, e.g. x=0.8:1.8,y=0.2:1.2; default around the run's."
        ),
    ] = None,
    episodes: Annotated[int, typer.Option(help="Throws, or other tries, to learn from.")] = 3000,
    method: Annotated[str, typer.Option(help=f"{one_of(CONTEXTUAL_NAMES)}.")] = "c_cma_es",
    seed: Annotated[int, typer.Option(help="Of contexts and search.")] = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE of the search, e.g. population=25."),
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, help="Threads; never changes a result.")
    ] = os.cpu_count() or 1,
) -> None:
    """Learn which motion belongs to which target, or place of an object."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.pipeline.finished_run import read_run
    from besman.templates.contexts import context_kind, parse_names, parse_region
    from besman.templates.files import learn_in_run, parse_settings, template_figures
    from besman.work.work import Work

    given = {"method": method, "episodes": episodes, "seed": seed}
    config = parse_settings(given, tuple(settings or ()))
    names = context_kind(read_run(run).task).choose(parse_names(context))
    wanted = parse_region(region, names) if region else {}
    with stage_display() as display:
        progress, end = display("template")
        template, path = learn_in_run(run, names, wanted, config, Work(jobs, progress))
        end(True)
    console, found = open_terminal(), template_figures(template)
    bounds = ", ".join(f"{k} {low:.2f} to {high:.2f}" for k, (low, high) in found["region"].items())
    miss = found["miss_m"]["median"]
    console.print(
        f"learnt {bounds} in {found['episodes']} episodes; {found['checks']} further contexts: "
        f"{100 * found['success_share']:.0f} % succeed, miss "
        + ("none landed" if miss is None else f"{100 * miss:.1f} cm (median)"),
        soft_wrap=True,
    )
    console.print(f"wrote {path}", soft_wrap=True)


@app.command("apply")
def apply(
    run: RunFolder,
    context: Annotated[str, typer.Option(help="For example x=2.3,y=0.4.")],
    out: Annotated[
        list[Path] | None,
        typer.Option(help="File to write: .csv, .json or .yaml (ROS 2), .script (URScript)."),
    ] = None,
    method: Annotated[
        str | None, typer.Option(help=f"{one_of(CONTEXTUAL_NAMES)}, if the run has several.")
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", help="Write forecast and limits here.", callback=target_file),
    ] = None,
) -> None:
    """Give the motion for a target, in milliseconds, within all limits."""
    from besman.cli.terminal import complain, open_terminal
    from besman.io.atomic_files import write_json
    from besman.robot.model import load_robot
    from besman.simulation.tasks.kinds import load_task
    from besman.templates.applying import apply_template
    from besman.templates.contexts import parse_context
    from besman.templates.files import describe_application, load_template, write_application

    template = load_template(run, method)
    values = parse_context(context, template.family.names)
    robot, task = load_robot(template.robot, template.tool), load_task(template.task)
    applied = apply_template(template, robot, task, values)
    forecast, limits = applied.forecast, applied.limits
    for warning in applied.warnings:
        complain("warning", warning)
    console = open_terminal()
    console.print(
        f"{applied.plan.name}: {applied.time[-1]:.3f} s, computed in "
        f"{1e3 * applied.wall_s:.0f} ms; predicted reward {forecast.reward:.3f} +- "
        f"{forecast.reward_spread:.3f}, miss "
        f"{100 * forecast.miss:.1f} cm; {100 * limits.velocity_ratio:.0f} % of the speed, "
        f"{100 * limits.acceleration_ratio:.0f} % of the acceleration and "
        f"{100 * limits.torque_ratio:.0f} % of the torque limits",
        soft_wrap=True,
    )
    write_application(applied, out or [])
    if json_file is not None:
        write_json(json_file, describe_application(applied))
    for path in out or []:
        console.print(f"wrote {path}", soft_wrap=True)
