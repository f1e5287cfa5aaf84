"""What a run cost beside table 7.1 of the thesis: machine time, and a person's."""

from __future__ import annotations

import html
from typing import Any

from besman.report.html_tables import html_table
from besman.report.timing import (
    THESIS_HUMAN_SECONDS,
    THESIS_THROWS,
    THESIS_TRANSFER_SECONDS,
    seconds,
    stage_rows,
)


def stage_tables(timing: dict[str, Any], results: dict[str, Any], config: dict[str, Any]) -> str:
    """Make both tables.

    Parameters
    ----------
    timing, results : dict
        ``timing.json`` and ``results.json``.
    config : dict
        ``pipeline.yaml``.

    Returns
    -------
    str
        HTML.
    """
    n = results.get("map", {}).get("n_demonstrations", 0)
    rows = stage_rows(timing, n)
    return (
        "<h2>What every stage cost</h2><h3>Machine time</h3>"
        + _machine([row for row in rows if not row["human"]], timing["total_wall_s"], n)
        + f'<p class="soft">Per item and faster: of the computation, also where it was cached. '
        f"Thesis: table 7.1 ({THESIS_THROWS} throws), scaled to the {n} demonstrations here; its "
        "imitation covers select, map and imitate, its policy search is refine; its "
        "transferability approach needs the real arm, and a person who brings back the ball.</p>"
        "<h3>A person's time</h3>"
        + _human([row for row in rows if row["human"]], results, config)
        + f'<p class="soft">Thesis: table 7.1, one experiment of {THESIS_THROWS} throws, not '
        "scaled; movements of 40 throws were labelled once. Here: what besman knows of it.</p>"
    )


def _machine(rows: list[dict[str, Any]], total_s: float, n: int) -> str:
    """One row a stage."""
    cells = [
        [
            row["name"],
            seconds(row["wall_s"]),
            seconds(row["cpu_s"]),
            f"{row['items']} {row['unit']}" if row["items"] else "",
            seconds(row["per_item_s"]) if row["per_item_s"] is not None else "",
            seconds(row["thesis_s"]) if row["thesis_s"] is not None else "",
            _factor(row["thesis_s"], row["computed_wall_s"]),
            "yes" if row["cached"] else "",
            _memory(row),
        ]
        for row in rows
    ]
    transfer = seconds(THESIS_TRANSFER_SECONDS * n / THESIS_THROWS) if n else ""
    cells.append(
        ["transfer to the real arm", "-", "-", "", "", transfer, "", "no part of a run", ""]
    )
    thesis_s = sum(row["thesis_s"] or 0.0 for row in rows)
    computed_s = sum(row["computed_wall_s"] for row in rows)
    total = [seconds(total_s), "", "", "", seconds(thesis_s) if thesis_s else ""]
    bold = ["<b>total, without transfer</b>", *(f"<b>{cell}</b>" if cell else "" for cell in total)]
    cells.append([*bold, _factor(thesis_s, computed_s), "", ""])
    header = ["stage", "wall", "CPU", "items", "per item", "thesis", "faster", "cached"]
    return html_table([*header, "memory [MB]"], cells)


def _factor(thesis_s: float | None, own_s: float) -> str:
    """Say how many times faster than the thesis."""
    if not thesis_s or own_s <= 0:
        return ""
    times = thesis_s / own_s
    return f"{times:.3g} x" if times < 1000 else f"{times:.0f} x"


def _memory(row: dict[str, Any]) -> str:
    """Say the greatest memory of this process so far, and of the greatest of its workers."""
    own, workers = f"{row['peak_rss_mb']:.0f}", row.get("workers", {})
    if not workers.get("n"):
        return own
    return f"{own} + {workers['n']} x {workers['peak_rss_mb']:.0f}"


def _human(rows: list[dict[str, Any]], results: dict[str, Any], config: dict[str, Any]) -> str:
    """One row for everything that a person does."""
    label = results.get("label", {})
    named = config.get("label", {}).get("method") == "named"
    names = label.get("names") or ()
    named |= bool(names) and not any(one["found"] for one in names)
    review = len(label.get("review") or ())
    markers = "names came with the recordings" if named else "none: automatic"
    if review:
        markers += f"; {review} trajectories to look at"
    recognize = config.get("recognize", {})
    examples = recognize.get("examples_per_class")
    labelled = "none: a trained model was given" if recognize.get("model") else "not measured"
    if examples is not None and not recognize.get("model"):
        labelled += f"; {examples} examples of each class"
    here = {
        "attaching markers": "not measured",
        "motion capture": "not measured",
        "naming markers by hand": markers,
        "labelling movements by hand": labelled,
    }
    cells = [
        [name, here[name], seconds(thesis_s)] for name, thesis_s in THESIS_HUMAN_SECONDS.items()
    ]
    cells += [[html.escape(row["name"]), seconds(row["wall_s"]), ""] for row in rows]
    return html_table(["what", "here", "thesis"], cells, words=True)
