"""What no arm is given: movements beyond a limit, or that touch something, and how that is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from besman.robot.limits import LimitReport

LIMITS = "limits.json"
"""Beside exports: what each motion asks of the arm."""

_LIMITED = ("position", "velocity", "acceleration", "jerk", "torque")


def withheld_because(report: LimitReport) -> str | None:
    """Say why an arm must not be given a movement.

    Parameters
    ----------
    report : LimitReport
        Of the movement as it would be written.

    Returns
    -------
    str or None
        Which limits it is beyond, in how many samples; none if it keeps all and touches nothing.
    """
    beyond = [
        f"beyond the limit of {name} in {getattr(report, name)}"
        for name in _LIMITED
        if getattr(report, name)
    ]
    if report.self_collisions:
        beyond.append(f"touching itself, its pedestal or the floor in {report.self_collisions}")
    return f"{', '.join(beyond)} of {report.samples} samples" if beyond else None


def exported_or_why(report: LimitReport) -> dict[str, Any]:
    """Say for ``limits.json`` whether a movement is exported, and if not, why.

    Parameters
    ----------
    report : LimitReport

    Returns
    -------
    dict
        exported; if it is not, withheld, a text.
    """
    why = withheld_because(report)
    return {"exported": why is None} | ({} if why is None else {"withheld": why})


def withheld_motions(folder: Path) -> dict[str, str]:
    """Read which motions were not exported, and why.

    Parameters
    ----------
    folder : Path
        Of exports.

    Returns
    -------
    dict of str
        Why, by the name that their files would have.
    """
    motions = json.loads((folder / LIMITS).read_text(encoding="utf-8"))["motions"]
    return {name: one["withheld"] for name, one in motions.items() if not one["exported"]}
