"""The table of stages: what each cost, beside the times of the thesis."""

from __future__ import annotations

from typing import Any

# Seconds per experiment of 8 throws: thesis table 7.1. "Imitation learning" covers the choice of
# demonstrations, their mapping and the motion plans; it stands in the row of the mapping.
THESIS_SECONDS = {"label": 298.0, "segment": 44.0, "recognize": 2.0, "map": 260.0, "refine": 600.0}
THESIS_THROWS = 8
# What a person did there, per experiment; labelled movements of 40 throws.
THESIS_HUMAN_SECONDS = {
    "attaching markers": 55.0,
    "motion capture": 68.0,
    "naming markers by hand": 559.0,
    "labelling movements by hand": 3000.0,
}
# The transferability approach: the real arm, helped by a person.
THESIS_TRANSFER_SECONDS = 4500.0


def stage_rows(timing: dict[str, Any], n_demonstrations: int) -> list[dict[str, Any]]:
    """Turn ``timing.json`` into rows of the stage table.

    Parameters
    ----------
    timing : dict
        Content of ``timing.json``.
    n_demonstrations : int
        Number of selected demonstrations, to which the thesis' times are scaled.

    Returns
    -------
    list of dict
        One row a stage with ``per_item_s`` and ``thesis_s`` (None where the thesis has none).
    """
    rows = []
    for stage in timing["stages"]:
        thesis = THESIS_SECONDS.get(stage["name"])
        scaled = None if thesis is None else thesis * n_demonstrations / THESIS_THROWS
        per_item = stage["computed_wall_s"] / stage["items"] if stage["items"] else None
        rows.append({**stage, "per_item_s": per_item, "thesis_s": scaled})
    return rows


def seconds(value: float | None) -> str:
    """Write a duration for people: ``12 ms``, ``3.4 s``, ``5:20 min``, ``2:30 h``."""
    if value is None:
        return "-"
    if value < 0.1:
        return f"{value * 1000:.2g} ms" if value < 0.01 else f"{value * 1000:.0f} ms"
    if value < 60:
        return f"{value:.2f} s" if value < 10 else f"{value:.1f} s"
    minutes, rest = divmod(round(value), 60)
    if minutes >= 120:
        return f"{minutes // 60}:{minutes % 60:02d} h"
    return f"{minutes}:{rest:02d} min"
