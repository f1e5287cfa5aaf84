"""``besman plan``: blocks of a run in another order, at other places. Heavy imports are lazy."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from besman.cli.options import Json

if TYPE_CHECKING:
    from rich.table import Table


def plan(
    run: Annotated[Path, typer.Argument(help="A finished run of whole tasks.")],
    goal: Annotated[
        str | None,
        typer.Option(help="'box1 on table at x=0.4,y=-0.3; box1 on shelf': one after the other."),
    ] = None,
    goals: Annotated[
        Path | None, typer.Option(help="YAML with goals: and start:, lists of the same.")
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(help="Where objects stand: 'box1 on shelf; box2 on table at x=0.4,y=-0.3'."),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Of the folder RUN/plans/NAME; default the next number.")
    ] = None,
    refine: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Try other ways where the first fails.")
    ] = True,
    json_file: Json = None,
) -> None:
    """Find the shortest order of learnt blocks to a goal, simulate it, and write it for the arm.

    Exit code 1 if it does not succeed in simulation: the files are those of what came nearest.
    """
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.exceptions import PlanError
    from besman.io.atomic_files import write_json
    from besman.planning.goals import parse_goals, parse_start, read_goals
    from besman.planning.planned_run import plan_run
    from besman.work.work import Work

    if (goal is None) == (goals is None):
        raise PlanError(
            f"expected one of --goal and --goals, got {'none' if goal is None else 'both'}"
        )
    said = start or ""
    if goals is not None:
        said, goal = read_goals(goals)
        if start is not None and said:
            raise PlanError(f"--start: {goals} has a start too; expected one of them")
        said = start or said
    wanted = parse_goals(goal or "")
    standing = parse_start(said) if said else ()
    with stage_display() as display:
        progress, end = display("plan")
        planned, place, content = plan_run(
            run, wanted, standing, name, refine, Work(progress=progress)
        )
        end(True)
    console = open_terminal()
    console.print(_table(content))
    console.print(_line(content), soft_wrap=True)
    console.print(f"wrote {place}", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, content)
    if not planned.success:
        raise typer.Exit(1)


def _table(content: dict[str, Any]) -> "Table":
    """Return one row a block."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("block", no_wrap=True)
    table.add_column("where, metres")
    for name in ("seconds", "miss", "ways"):
        table.add_column(name, justify="right")
    table.add_column("success")
    for one in content["blocks"]:
        where = "rest"
        if "x_m" in one:
            where = f"{one['object']}: {one['place']} {one['x_m']:.2f}, {one['y_m']:.2f}"
        outcome = ("", "", "")
        if "miss_m" in one:
            said = "yes" if one["success"] else one["failure"] or "beside its place"
            outcome = (_millimetres(one["miss_m"]), str(one["tries"]), said)
        seconds = f"{one['duration_s']:.1f}"
        table.add_row(one["label"], where, seconds, *outcome)
    return table


def _line(content: dict[str, Any]) -> str:
    """Say what comes of all."""
    said = "succeeds" if content["success"] else "does not succeed"
    why = f": {content['failure']}" if content["failure"] else ""
    return (
        f"{'; '.join(content['goals'])}: {said} in simulation{why}; "
        f"{_millimetres(content['miss_m'])} off in the end, {content['duration_s']:.1f} s, "
        f"{content['tries']} ways tried"
    )


def _millimetres(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm" if metres < 1.0 else "-"
