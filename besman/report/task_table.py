"""Whole tasks of a run: one row a block."""

from __future__ import annotations

import html
from itertools import groupby
from typing import Any

import numpy as np

from besman.records import TaskPlan
from besman.records.task_trial import TaskTrial
from besman.report.html_tables import html_table

_HEADER = ["task", "block", "leads to", "begins [s]", "takes [s]", "imitation error [mm]"]
_OUTCOME = ["box beside its place [mm]", "turned [deg]", "simulations", "success"]
_LEADS = {"world": "a place in the world", "object": "the {}", "target": "the place of the {}"}


def task_table(records: dict[str, Any]) -> str:
    """Make one row a block of all whole tasks; the block that puts its object has the outcome.

    Parameters
    ----------
    records : dict
        Of the run's stages.

    Returns
    -------
    str
        HTML; "" if the run has none.
    """
    imitated: tuple[TaskPlan, ...] = records.get("task_plans", ())
    if not imitated:
        return ""
    aimed = {plan.name: plan for plan in records.get("aim", ())}
    trials = {trial.name: (trial, 1) for trial in records.get("simulate", ())}
    for one in records.get("refine_tasks", ()):
        aimed[one.plan.name], trials[one.plan.name] = one.plan, (one.trial, one.tries)
    rows = []
    for plan in imitated:
        rows += _rows(plan, aimed.get(plan.name, plan), trials.get(plan.name))
    header = _HEADER + (_OUTCOME if trials else [])
    said = (
        "Seconds are those of the arm's own clock, without the time that its gripper takes; the "
        "last block that leads to an object or its place has the straight ways there and on in it. "
        "Imitation error: greatest distance of the tool from the mapped movement at the same time."
    )
    return (
        f'<h2>Whole tasks, block by block</h2>{html_table(header, rows)}<p class="soft">{said}</p>'
    )


def _rows(
    plan: TaskPlan, shown: TaskPlan, outcome: tuple[TaskTrial, int] | None
) -> list[list[str]]:
    """Return the rows of one task."""
    errors: dict[str, list[float]] = {}
    for block in plan.blocks:
        if block.path_error is not None:
            errors.setdefault(block.label, []).append(block.path_error)
    numbered = enumerate(shown.blocks)
    rows = []
    put = max((k for k, b in enumerate(shown.blocks) if b.frame == "target"), default=-1)
    for (label, frame, thing), group in groupby(
        numbered, lambda pair: (pair[1].label, pair[1].frame, pair[1].thing)
    ):
        own = [k for k, _ in group]
        start, end = shown.starts_s[own[0]], shown.starts_s[own[-1] + 1]
        known = errors.get(label, [])
        row = [
            html.escape(plan.name),
            html.escape(label),
            html.escape(_LEADS[frame].format(thing)),
            f"{start:.2f}",
            f"{end - start:.2f}",
            f"{1e3 * max(known):.1f}" if known else "-",
        ]
        if outcome is not None:
            row += _outcome(*outcome) if put in own else [""] * len(_OUTCOME)
        rows.append(row)
    return rows


def _outcome(trial: TaskTrial, tries: int) -> list[str]:
    """Say what came of a task."""
    tone, word = ("good", "yes") if trial.success else ("bad", html.escape(trial.failure) or "no")
    miss, angle = 1e3 * trial.miss, np.degrees(trial.angle)
    there = not trial.failure and np.isfinite(miss)
    return [
        f"{miss:.1f}" if there else "-",
        f"{angle:.1f}" if there else "-",
        str(tries),
        f'<span class="{tone}">{word}</span>',
    ]
