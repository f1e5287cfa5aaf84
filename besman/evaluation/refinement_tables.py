"""The comparison of searches as tables for the terminal and as curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.io.atomic_files import make_folder, written_aside
from besman.report.figures import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

_COLUMNS = ("success", "episodes", "CPU s", "final reward")
_DPI = 150


def refinement_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Return one table for each problem.

    Parameters
    ----------
    rows : sequence of dict
        Of `besman.evaluation.refinement.evaluate_refinement`.
    """
    from rich.box import SIMPLE
    from rich.table import Table

    tables = []
    for own in _by_problem(rows):
        first = own[0]
        marks = [mark for mark in first["rewards_at"] if int(mark) < first["episodes_budget"]]
        has_public = any(row["public"] is not None for row in own)
        table = Table(
            title=f"{first['dataset']}: {first['n_runs']} runs of {first['episodes_budget']} "
            "episodes each",
            caption=f"success: {first['success']}; episodes and CPU seconds to it: median "
            "(quartiles) of the runs that succeeded; rewards: mean +- standard error of the runs",
            box=SIMPLE,
            pad_edge=False,
        )
        table.add_column("search", no_wrap=True)
        columns = [*_COLUMNS[:3], *(f"after {mark}" for mark in marks), _COLUMNS[3]]
        for column in [*columns, *(["public"] if has_public else [])]:
            table.add_column(column, justify="right", no_wrap=True)
        for row in own:
            cells = [
                row["method"],
                f"{row['n_success']}/{row['n_runs']}",
                _quartiles(row["episodes"], ".0f"),
                _quartiles(row["cpu_s"], ".2g"),
                *(_mean(row["rewards_at"][mark]) for mark in marks),
                _mean(row["final_reward"]),
            ]
            table.add_row(*cells, *([_public(row["public"])] if has_public else []))
        tables.append(table)
    return tables


def _by_problem(rows: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    names = dict.fromkeys(row["dataset"] for row in rows)
    return [[row for row in rows if row["dataset"] == name] for name in names]


def _quartiles(values: dict[str, float] | None, style: str) -> str:
    if values is None:
        return "-"
    return f"{values['median']:{style}} ({values['q25']:{style}}-{values['q75']:{style}})"


def _mean(values: dict[str, float | None]) -> str:
    """Write a mean, and its standard error if there is one: of one run alone there is none."""
    error = values["standard_error"]
    return f"{values['mean']:.3g}" + ("" if error is None else f" +- {error:.2g}")


def _public(figures: Any) -> str:
    """Write published figures: one number, or mean and standard error at the marks."""
    if figures is None:
        return ""
    if isinstance(figures, int | float):
        return f"{figures:g}"
    return ", ".join(f"{mean:g} +- {error:g}" for mean, error in figures)


def write_curves(rows: Sequence[dict[str, Any]], folder: Path) -> list[Path]:
    """Draw the best reward so far over episodes for each problem.

    Parameters
    ----------
    rows : sequence of dict
        Of `besman.evaluation.refinement.evaluate_refinement`.
    folder : Path
        Made if need be.

    Returns
    -------
    list of Path
        PNG files, ``PROBLEM_curves.png``.
    """
    make_folder(folder)
    written = []
    for own in _by_problem(rows):
        written.append(folder / f"{own[0]['dataset']}_curves.png")
        with written_aside(written[-1]) as temporary:
            draw_curves(own).savefig(temporary, dpi=_DPI, metadata={"Software": None})
    return written


def draw_curves(rows: Sequence[dict[str, Any]]) -> Figure:
    """Draw the medians of the searches on one problem, and what lies between the quartiles.

    Parameters
    ----------
    rows : sequence of dict
        Of one problem.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for row, colour in zip(rows, COLOURS, strict=False):
        curve = row["curve"]
        episodes = np.array(curve["episodes"])
        low, middle, high = (-np.array(curve[q]) for q in ("0.75", "0.5", "0.25"))
        axes.fill_between(episodes, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.plot(episodes, middle, color=colour, label=row["method"])
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("episodes")
    axes.set_ylabel("cost of the best so far (minus reward)")
    axes.set_title(f"{rows[0]['dataset']}: median and quartiles of {rows[0]['n_runs']} runs")
    axes.legend(frameon=False)
    return figure
