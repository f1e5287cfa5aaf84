"""The rows of the segmentation experiment as tables for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

_HEADINGS = ("method", "F1", "95 %", "TP", "FP", "offset", "F1", "label", "time", "thesis*")
_UNITS = ("", "", "", "", "", "[s]", "end", "right", "[s]", "F1 TP FP")


def segmentation_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Return one table for each dataset, for the terminal."""
    from rich.table import Table

    tables = []
    keys = list(dict.fromkeys((row["dataset"], row["source"]) for row in rows))
    for name, source in keys:
        chosen = [row for row in rows if (row["dataset"], row["source"]) == (name, source)]
        first = chosen[0]
        n = first["n_recordings"]
        title = f"{name}: {source}, {n} recordings, margin {first['margin_s']:g} s"
        if any("n_settings" in row for row in chosen):
            title += "; (48) settings"
        number = next((row["thesis"]["table"] for row in chosen if row["thesis"]), "")
        table = Table(
            title=title,
            caption=f"* table {number} of the thesis, measured on other data" if number else None,
            title_justify="left",
            caption_justify="left",
            title_style="bold",
            box=None,
            padding=(0, 1, 0, 0),
        )
        for heading, unit in zip(_HEADINGS, _UNITS, strict=True):
            side = "left" if heading == "method" else "right"
            table.add_column(f"{heading}\n{unit}", justify=side, no_wrap=True)  # type: ignore[arg-type]
        for row in chosen:
            table.add_row(*_cells(row))
        tables.append(table)
    return tables


def _cells(row: dict[str, Any]) -> list[str]:
    method = row["method"]
    if row.get("n_settings", 1) > 1:
        method += f" ({row['n_settings']})"
    thesis = row["thesis"]
    return [
        method,
        f"{row['f1']:.3f}",
        f"{row['f1_low']:.2f}-{row['f1_high']:.2f}",
        f"{row['tp']:.2f}",
        f"{row['fp']:.2f}",
        f"{row['median_offset_s']:+.3f}",
        f"{row['f1_end']:.2f}" if "f1_end" in row else "",
        "" if row["accuracy"] is None else f"{100 * row['accuracy']:.0f} %",
        f"{row['seconds_per_recording']:.3f}",
        "" if thesis is None else f"{thesis['f1']:.2f} {thesis['tp']:.1f} {thesis['fp']:.1f}",
    ]
