"""Where motions end up in a second engine beside MuJoCo: a table for terminal and page."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any, Literal

from besman.pipeline.stored_run import StoredRun
from besman.pipeline.verification_file import read_verification
from besman.report.centimetres import centimetres
from besman.report.html_tables import html_table

if TYPE_CHECKING:
    from rich.table import Table

_UNITS = "outcomes in metres, miss and apart in centimetres"
_WORDS = ("motion", "hit")


def verification_table(results: dict[str, Any]) -> Table:
    """Return one row a motion.

    Parameters
    ----------
    results : dict
        What `besman.pipeline.verified_run.verify_run` gave.
    """
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False, caption=_UNITS)
    header, rows = _header(results), _rows(results)
    for name in header:
        # Why something failed may take several lines.
        justify: Literal["left", "right"] = "right" if name not in _WORDS else "left"
        table.add_column(name, justify=justify, no_wrap=name != "hit")
    for row in rows:
        table.add_row(*row)
    return table


def verification_lines(results: dict[str, Any]) -> list[str]:
    """Say for each engine how many motions hit, and how far apart the two are."""
    lines = []
    for engine in ("mujoco", results["engine"]):
        found = results[engine]
        near = ", ".join(f"{n} within {radius}" for radius, n in found["within"].items())
        lines.append(
            f"{engine}: {found['n_success']} of {results['n_motions']} succeed, {near}, miss "
            f"{centimetres(found['miss_m']['median'])} (median), "
            f"{centimetres(found['miss_m']['max'])} (most)"
        )
    apart = results["apart_m"]
    lines.append(
        f"{centimetres(apart['median'])} apart (median), {centimetres(apart['max'])} (most)"
    )
    return lines


def verification_section(run: StoredRun) -> str:
    """Return the section of a run's page; "" if its motions were not tried in a second engine."""
    results = read_verification(run)
    if results is None:
        return ""
    engine = html.escape(f"{results['engine']} {results['version']}")
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in verification_lines(results))
    header = [html.escape(name) for name in _header(results)]
    rows = [[html.escape(cell) for cell in row] for row in _rows(results)]
    return (
        f"<h2>In a second engine: {engine}</h2><ul>{lines}</ul>"
        + html_table(header, rows, sortable=True)
        + '<p class="soft">The same arm, tool, object, servos and friction, built anew in an '
        "engine that shares no code with MuJoCo; contact is on patches of surfaces. Here "
        f"{_UNITS}.</p>"
    )


def _header(results: dict[str, Any]) -> list[str]:
    engine = results["engine"]
    return ["motion", "mujoco", "miss", engine, "miss", "apart", "hit"]


def _rows(results: dict[str, Any]) -> list[list[str]]:
    """Return the cells of every motion."""
    engine = results["engine"]
    rows = []
    for one in results["motions"]:
        first, second = one["mujoco"], one[engine]
        said = "yes" if second["success"] else second["failure"] or "no"
        rows.append(
            [
                one["motion"],
                _place(first["outcome_m"]),
                _hundredfold(first["miss_m"]),
                _place(second["outcome_m"]),
                _hundredfold(second["miss_m"]),
                _hundredfold(one["apart_m"]),
                said,
            ]
        )
    return rows


def _place(metres: list[float | None]) -> str:
    known = [value for value in metres if value is not None]
    if len(known) < 3:
        return "-"
    # On the floor the height says nothing.
    return " ".join(f"{value:.2f}" for value in (known if known[2] else known[:2]))


def _hundredfold(metres: float | None) -> str:
    return "-" if metres is None else f"{100 * metres:.1f}"
