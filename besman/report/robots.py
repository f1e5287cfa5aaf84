"""The summary of a movement on several robots, in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from besman.pipeline.stored_run import open_run
from besman.report.centimetres import centimetres
from besman.report.timing import seconds

if TYPE_CHECKING:
    from rich.table import Table

    from besman.pipeline.retarget import Retargeted


def retargeted_table(done: tuple[Retargeted, ...]) -> Table:
    """Make a table with one row a robot.

    Parameters
    ----------
    done : tuple of Retargeted

    Returns
    -------
    rich.table.Table
    """
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("robot", no_wrap=True)
    for name in ("mapped", "error [mm]", "p95", "max", "stretch", "refined", "miss", "time"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in done:
        folder = one.plan.folder
        if one.error is not None:
            table.add_row(one.plan.name, "failed")
        else:
            run = open_run(folder)
            results = run.read("results.json")
            wall = seconds(run.read("timing.json")["total_wall_s"])
            table.add_row(one.plan.name, *_figures(results), wall)
    return table


def _figures(results: dict[str, Any]) -> list[str]:
    """Return the figures of one robot."""
    mapped, refined = results["map"], results["refine"]
    error, miss = mapped["position_error_m"], refined["miss_m"]["median"]
    return [
        f"{mapped['n_transferred']} of {mapped['n_demonstrations']}",
        *(f"{1000 * error[name]:.1f}" for name in ("mean", "p95", "max")),
        f"{mapped['time_stretch']['median']:.2f}",
        f"{refined['n_success']} of {refined['n_motions']}",
        centimetres(miss),
    ]
