"""Commands about run folders: runs, clean, join; and what check says of one."""

from pathlib import Path
from typing import Annotated

import typer

from besman.cli.options import target_folder
from besman.cli.terminal import open_terminal, say


def say_check(folder: Path) -> None:
    """Say what is whole in a run folder and what is not; exit code 1 if something is not."""
    from besman.pipeline.check_run import check_run

    whole, faults = check_run(folder)
    for line in whole:
        say(line)
    for line in faults:
        say(f"not whole: {line}")
    if faults:
        say("the command that made the run repairs it")
        raise typer.Exit(1)


def runs(
    folder: Annotated[Path, typer.Argument(help="A folder of runs.")] = Path("runs"),
) -> None:
    """List the runs in a folder: status, recipe, size."""
    from besman.pipeline.runs import list_runs
    from besman.report.runs_table import runs_table

    found = list_runs(folder)
    if not found:
        say(f"{folder}: no runs here")
        return
    open_terminal().print(runs_table(found, folder))


def clean(
    run: Annotated[Path, typer.Argument(help="A run folder.")],
    yes: Annotated[bool, typer.Option("--yes", help="Remove it, in place of saying so.")] = False,
) -> None:
    """Say what lies in a run folder and is no part of the run; with --yes remove it."""
    from besman.pipeline.runs import find_removable, remove
    from besman.report.runs_table import size

    found = find_removable(run)
    if not found:
        say(f"{run}: nothing to remove")
        return
    for one in found:
        say(f"{one.path.relative_to(run)}: {size(one.n_bytes)}, {one.why}")
    total = size(sum(one.n_bytes for one in found))
    if yes:
        remove(run, found)
        say(f"removed: {total}")
    else:
        say(f"{total} in all; besman clean {run} --yes removes it")


def join(
    run: Annotated[Path, typer.Argument(help="A finished run.")],
    motions: Annotated[list[str], typer.Argument(help="Names of its motions, in their order.")],
    out: Annotated[
        Path, typer.Option(help="Folder for the files and limits.json.", callback=target_folder)
    ],
    blend_s: Annotated[
        float, typer.Option(min=0, max=5, help="How long before its end the next begins, at most.")
    ] = 0.2,
) -> None:
    """Write motions of a run as one movement that does not stop between them."""
    from besman.pipeline.joined_motions import join_motions

    asked = join_motions(run, motions, out, blend_s)["joined"]
    starts = ", ".join(f"{start:.2f}" for start in asked["starts_s"])
    say(f"{len(motions)} motions in {asked['duration_s']:.2f} s, begun at {starts} s")
    beyond = sum(asked[name] for name in ("position", "velocity", "acceleration", "torque", "jerk"))
    say(f"{beyond} samples outside a limit, {asked['self_collisions']} in self-collision")
    if asked["approach"] is None:
        say(f"no move to its start: {asked['no_approach']}")
    say(f"wrote {out}")
