"""Confusion matrix and accuracy of each class, as a table of the report."""

from __future__ import annotations

import html
from typing import Any


def confusion_table(results: dict[str, Any]) -> str:
    """Return the confusion of detected segments as HTML; nothing without truth.

    Parameters
    ----------
    results : dict
        The run's ``results.json``; its section ``recognize`` counts found labels by true label.

    Returns
    -------
    str
        One row for each true class, one column for each label found, and the share that is right
        of detected and of manual segments.
    """
    recognize = results.get("recognize", {})
    confusion: dict[str, dict[str, int]] = recognize.get("confusion") or {}
    if not confusion:
        return ""
    found = sorted({label for row in confusion.values() for label in row} | set(confusion))
    head = "".join(f"<th>{html.escape(name)}</th>" for name in [*found, "right", "right, manual"])
    by_hand = recognize.get("per_class_manual", {})
    lines = []
    for true, counts in confusion.items():
        cells = [_count(counts.get(name, 0), name == true) for name in found]
        cells += [_share(recognize["per_class"].get(true)), _share(by_hand.get(true))]
        lines.append(f"<tr><td>{html.escape(true)}</td>{''.join(cells)}</tr>")
    return (
        "<h2>Labels found against labels given by hand</h2>"
        f'<div class="scroll"><table><tr><th>true class</th>{head}</tr>{"".join(lines)}</table>'
        '</div><p class="soft">Detected segments that overlap a manual one by half or more; those '
        "learnt from are left out. The last column names the manual segments themselves."
        "</p>"
    )


def _count(count: int, right: bool) -> str:
    if count == 0:
        return '<td class="soft">·</td>'
    return f'<td class="{"good" if right else "bad"}">{count}</td>'


def _share(share: float | None) -> str:
    return "<td>-</td>" if share is None else f"<td>{share:.0%}</td>"
