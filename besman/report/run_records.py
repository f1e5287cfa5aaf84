"""The records of a run as the report looks at them: stages, and what each arm learnt."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from besman.config.resources import robot_title
from besman.pipeline.stage_store import RECORD
from besman.pipeline.stored_run import open_run
from besman.records import RefinedMotion
from besman.records.files import load_record
from besman.records.layers import Side


@dataclass(frozen=True, eq=False)
class ArmRecords:
    """What one arm of a run learnt.

    Attributes
    ----------
    suffix : str
        Of its stages and its exports: "", of a second arm ``_second``.
    title : str
        For headings: "" if the run has one arm.
    config : dict
        Its robot and tool.
    side : "right" or "left"
        The person's hand that it follows.
    mapping : Mapping
    motions : tuple of RefinedMotion
        Empty before refinement.
    robustness : dict
        Of each motion, where it was examined, by name.
    """

    suffix: str
    title: str
    config: dict[str, str]
    side: Side
    mapping: Any
    motions: tuple[RefinedMotion, ...] = ()
    robustness: dict[str, Any] = field(default_factory=dict)

    @property
    def heading(self) -> str:
        """The end of a heading."""
        return f" ({self.title})" if self.title else ""


SHOWN = frozenset(
    {"truth", "label", "recognize", "compose", "actions", "map", "refine", "robustness"}
    | {"refine_second", "robustness_second", "task_plans", "aim", "simulate", "refine_tasks"}
)
"""Stages whose records a report shows."""


def load_records(folder: Path, names: Container[str] | None = None) -> dict[str, Any]:
    """Load the records of the stages that a run has done, by their names; and ``truth``.

    Parameters
    ----------
    folder : Path
        A run folder.
    names : container of str, optional
        Those alone.
    """
    run = open_run(folder)
    found = {
        name: run.record(name)
        for name, place in run.stages.items()
        if (names is None or name in names) and (place / RECORD).is_file()
    }
    if (names is None or "truth" in names) and (folder / "truth.npz").is_file():
        found["truth"] = load_record(folder / "truth.npz")
    return found


def arm_records(records: dict[str, Any], config: dict[str, Any]) -> tuple[ArmRecords, ...]:
    """Sort what was mapped and refined by arms.

    Parameters
    ----------
    records : dict
        What `load_records` gave.
    config : dict
        The run's ``pipeline.yaml``.

    Returns
    -------
    tuple of ArmRecords
        One or two; none before mapping.
    """
    if "map" not in records:
        return ()
    mappings = records["map"] if isinstance(records["map"], tuple) else (records["map"],)
    configs = (config, config.get("second_arm") or {})
    first: Side = config["select"].get("arm", "right")
    sides: tuple[Side, Side] = (first, "left" if first == "right" else "right")
    arms = []
    for mapping, part, side, suffix in zip(mappings, configs, sides, ("", "_second"), strict=False):
        name = robot_title(part["robot"])
        arms.append(
            ArmRecords(
                suffix=suffix,
                title=f"{name}, {side} hand" if len(mappings) > 1 else "",
                config=part,
                side=side,
                mapping=mapping,
                motions=records.get(f"refine{suffix}", ()),
                robustness={one.name: one for one in records.get(f"robustness{suffix}", ())},
            )
        )
    return tuple(arms)
