"""The commands of ``besman transfer``. Everything heavy is imported by its command."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from besman.cli.options import ALL_CORES, Jobs, target_folder

if TYPE_CHECKING:
    from besman.transfer.state import TransferState
    from besman.transfer.tries import FloatArray

app = typer.Typer(help="From simulation to the real arm, in few tries.", no_args_is_help=True)

RunFolder = Annotated[Path, typer.Argument(help="A finished run of a throw.")]


@app.command("suggest")
def suggest(
    run: RunFolder,
    motion: Annotated[str | None, typer.Option(help="A refined motion; default the first.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write to; default RUN/transfer.", callback=target_folder),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Of the search, said at a motion's first try; default 0."),
    ] = None,
    surrogate: Annotated[
        str | None,
        typer.Option(
            help="jacobian, gaussian_process or inverse_distance, said at a motion's first try; "
            "default jacobian."
        ),
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="The arm as besman identify has found it, a robot.yaml.")
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, help="Threads; never changes a result.")
    ] = os.cpu_count() or 1,
) -> None:
    """Write the next trajectory to try on the real arm, and a row to fill in."""
    from besman.cli.progress_bars import stage_display
    from besman.exceptions import TransferError, nearest
    from besman.transfer.approach import TransferConfig
    from besman.transfer.tries import suggest_try

    kinds = ("jacobian", "gaussian_process", "inverse_distance")
    if surrogate is not None and surrogate not in kinds:
        raise TransferError(f"--surrogate: got {surrogate!r}; {nearest(surrogate, kinds)}")
    said = {"seed": seed, "surrogate": surrogate}
    config = TransferConfig.model_validate({k: v for k, v in said.items() if v is not None})
    with stage_display() as display:
        progress, end = display("suggest")
        found = suggest_try(run, motion, out, config, jobs, robot, progress)
        end(True)
    state, (x, y) = found.state, found.state.tries[-1].expected_m
    if found.anew:
        arm = f"with {robot}" if robot else "with the run's arm; --robot takes the one before"
        _print(f"the tries before were made with another robot.yaml: simulated anew {arm}")
    if found.told_by:
        n, n_motions = len(found.told_by), len(set(found.told_by))
        _print(f"found in the model that landings tell: {n}, of motions: {n_motions}")
    _print(
        f"try {len(state.tries)} of {state.motion}: target {found.target[0]:.2f} m ahead, "
        f"{found.target[1]:.2f} m left; expected {x:.2f} m ahead, {y:.2f} m left"
    )
    for path in sorted(found.folder.iterdir()):
        _print(f"wrote {path}")
    _print(f"then fill in x_m, y_m and success in {found.table}")
    _print(f"and: besman transfer record {run} {found.table}")


def identify(
    run: Annotated[Path, typer.Argument(help="A finished run, whose motions were executed.")],
    executions: Annotated[
        list[Path],
        typer.Argument(
            help="Logs of joint angles, or folders of them: CSV, or bags with joint states."
        ),
    ],
    motion: Annotated[
        str | None, typer.Option(help="The motion that all logs are of; default by their names.")
    ] = None,
    fit_start: Annotated[
        bool,
        typer.Option("--fit-start", help="Times do not count from where a motion was sent off."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write to; default beside the robot.yaml, RUN/identified of robots that "
            "come along.",
            callback=target_folder,
        ),
    ] = None,
    jobs: Jobs = ALL_CORES,
) -> None:
    """Fit a run's arm to what it did: delays, gains, frictions, payload; write a robot.yaml."""
    from besman.cli.progress_bars import stage_display
    from besman.transfer.identification.identify import identification_lines, identify_arm
    from besman.work.work import Work

    with stage_display() as display:
        progress, end = display("identify")
        found = identify_arm(run, executions, motion, fit_start, out, Work(jobs, progress))
        end(True)
    for line in identification_lines(found.results):
        _print(line)
    _print(f"wrote {found.path} and {found.path.with_suffix('.json').name}")
    _print(f"from here on: --set robot={found.path}")


@app.command("record")
def record(
    run: RunFolder,
    results: Annotated[Path, typer.Argument(help="The table that was filled in.")],
) -> None:
    """Take measured touchdowns, and say how far from the target they are."""
    from besman.pipeline.finished_run import read_run
    from besman.transfer.tries import record_tries

    found = record_tries(run, results)
    radius = read_run(run).task.success_radius_m
    for state, target in found:
        for line in _tries(state, target, radius):
            _print(line)


def _tries(state: "TransferState", target: "FloatArray", radius: float) -> list[str]:
    """Say of every try how far it was from the target."""
    from besman.transfer.tries import miss_distances

    lines = [f"{state.motion}:"]
    far = miss_distances(state, target)
    for number, (one, metres) in enumerate(zip(state.tries, far, strict=True), 1):
        said = "failed" if one.failed else "not recorded yet"
        if metres is not None:
            said = f"{100 * metres:.1f} cm from the target"
        lines.append(f"  try {number}: {said}")
    known = [metres for metres in far if metres is not None]
    if known and min(known) <= radius:
        lines.append(f"  within {100 * radius:.0f} cm: done")
    elif all(one.recorded for one in state.tries):
        lines.append("  next: besman transfer suggest")
    return lines


def _print(line: str) -> None:
    """Print a line as it is."""
    from besman.cli.terminal import open_terminal

    open_terminal().print(line, soft_wrap=True)
