"""The study of embodiment mapping as tables for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

_MOST_FAILURES = 10


def mapping_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Return what the arms reach, and how fast, by class and robot.

    Parameters
    ----------
    rows : sequence of dict
        Of `besman.evaluation.mapping.evaluate_mapping`.
    """
    title = ", ".join(sorted({f"{row['dataset']} ({row['source']})" for row in rows}))
    return [_reach_table(rows, title), _time_table(rows, title)]


def _new_table(title: str, caption: str, columns: Sequence[str]) -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(title=title, caption=caption, box=SIMPLE, pad_edge=False)
    table.add_column("class", no_wrap=True)
    table.add_column("robot", no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _reach_table(rows: Sequence[dict[str, Any]], title: str) -> Table:
    """Return how many demonstrations are transferred, and how near the tool stays to them."""
    caption = "errors over all samples: mean / 95th percentile / greatest"
    thesis = next((row["thesis"] for row in rows if row["thesis"]), None)
    if thesis:
        n, n_all = thesis["n_transferred_to_all"], thesis["n_demonstrations"]
        caption += f"; thesis: {n} of {n_all} real throws to all of its four robots"
    columns = ("moved", "to all", "position\n\\[mm]", "orientation\n\\[deg]", "DTW\n\\[mm]")
    table = _new_table(title, caption, columns)
    for row, label in zip(rows, _labels(rows), strict=True):
        n = row["n_demonstrations"]
        table.add_row(
            label,
            row["robot"],
            f"{row['n_transferred']}/{n}",
            f"{row['n_transferred_to_all']}/{n}" if label else "",
            _spread(row["position_error_m"], 1000.0, 1),
            _spread(row["orientation_error_deg"], 1.0, 1),
            "-" if row["dtw_m"] is None else f"{1000 * row['dtw_m']['mean']:.2f}",
        )
    return table


def _time_table(rows: Sequence[dict[str, Any]], title: str) -> Table:
    """Return how much slower the arms are, what they violate, and what the mapping costs."""
    caption = (
        "unscaled: share as fast as demonstrated; stretch of time: median / 95th percentile / "
        "greatest; outside: samples at 1 kHz beyond a limit / in self-collision"
    )
    columns = ("unscaled\n\\[%]", "stretch", "outside", "s each", "peak\n\\[MB]")
    table = _new_table(title, caption, columns)
    for row, label in zip(rows, _labels(rows), strict=True):
        share = row["unscaled_share"]
        table.add_row(
            label,
            row["robot"],
            "-" if share is None else f"{100 * share:.0f}",
            _spread(row["time_stretch"], 1.0, 2),
            f"{row['limit_violations']} / {row['self_collisions']}",
            f"{row['seconds_per_demonstration']:.3f}",
            f"{row['peak_rss_mb']:.0f}",
        )
    return table


def _labels(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the class of each row, empty where it is that of the row before."""
    keys = [(row["dataset"], row["label"]) for row in rows]
    return [
        key[1] if index == 0 or key != keys[index - 1] else "" for index, key in enumerate(keys)
    ]


def _spread(values: dict[str, float] | None, factor: float, digits: int) -> str:
    """Write middle, 95th percentile and maximum."""
    if values is None:
        return "-"
    return " / ".join(f"{factor * value:.{digits}f}" for value in values.values())


def reason_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the first reasons for which demonstrations were not transferred, one a line."""
    lines = [
        f"{row['robot']}, {row['label']}: {one['name']}: {one['reason']}"
        for row in rows
        for one in row["failed"]
    ]
    more = len(lines) - _MOST_FAILURES
    return lines[:_MOST_FAILURES] + ([f"and {more} more, see --json"] if more > 0 else [])
