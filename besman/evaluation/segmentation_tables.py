"""The rows of the segmentation experiment as tables for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table


def segmentation_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Return one table for each dataset, for the terminal."""
    from rich.table import Table

    tables = []
    keys = list(dict.fromkeys((row["dataset"], row["source"]) for row in rows))
    for name, source in keys:
        chosen = [row for row in rows if (row["dataset"], row["source"]) == (name, source)]
        first = chosen[0]
        title = f"{name} ({source}, {first['n_recordings']} recordings"
        if "n_settings" in first:
            title += ", mean over up to 48 settings"
        number = next((row["thesis"]["table"] for row in chosen if row["thesis"]), "")
        theirs = f"thesis {number} F1 TP FP\n(other data)" if number else "thesis"
        table = Table(title=f"{title}, margin {first['margin_s']:g} s)", title_justify="left")
        for heading in (
            "method",
            "F1 [95 %]",
            "TP",
            "FP",
            "offset\n[s]",
            "F1 TP FP\nwith end",
            "label\naccuracy",
            "s per\nrecording",
            theirs,
        ):
            table.add_column(heading, justify="left" if heading == "method" else "right")
        for row in chosen:
            table.add_row(*_cells(row))
        tables.append(table)
    return tables


def _cells(row: dict[str, Any]) -> list[str]:
    end = "-"
    if "f1_end" in row:
        end = f"{row['f1_end']:.2f} {row['tp_end']:.1f} {row['fp_end']:.1f}"
    method = row["method"]
    if "n_settings" in row:
        method += f" ({row['n_settings']})"
    thesis = row["thesis"]
    return [
        method,
        f"{row['f1']:.3f} [{row['f1_low']:.2f} {row['f1_high']:.2f}]",
        f"{row['tp']:.2f}",
        f"{row['fp']:.2f}",
        f"{row['median_offset_s']:+.3f}",
        end,
        "-" if row["accuracy"] is None else f"{100 * row['accuracy']:.0f} %",
        f"{row['seconds_per_recording']:.3f}",
        "-" if thesis is None else f"{thesis['f1']:.2f} {thesis['tp']:.1f} {thesis['fp']:.1f}",
    ]
