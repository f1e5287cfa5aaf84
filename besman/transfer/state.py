"""What is known of one motion's tries, in the run folder."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import TransferError
from besman.foreign.json_text import parse_json
from besman.foreign.names import fault_of_name
from besman.io.atomic_files import make_folder, write_json, write_record
from besman.records import RefinedMotion
from besman.records.files import digest, load_record
from besman.records.recordings import FARTHEST_M
from besman.transfer.approach import RealTry, TransferConfig
from besman.transfer.archive import Archive, no_plans

_VERSION = 1


@dataclass(frozen=True)
class Suggested:
    """One try.

    Attributes
    ----------
    row : int
        Of the archive.
    expected_m : pair of float
        Where the surrogate expected it to come down.
    outcome_m : pair of float, optional
        Where it did; None until it is recorded, and if it failed.
    failed : bool
    """

    row: int
    expected_m: tuple[float, float]
    outcome_m: tuple[float, float] | None = None
    failed: bool = False

    @property
    def recorded(self) -> bool:
        """Whether it is known what came of it."""
        return self.failed or self.outcome_m is not None


@dataclass(frozen=True)
class TransferState:
    """All tries of one motion.

    Attributes
    ----------
    motion : str
        Its name.
    key : str
        Digest of the refined motion.
    config : TransferConfig
        How tries are found.
    archive : Archive
        What was simulated.
    tries : tuple of Suggested
    drives : str
        Digest of what was known of the arm's drives when it was simulated; "" if nobody noted it.
    """

    motion: str
    key: str
    config: TransferConfig
    archive: Archive
    tries: tuple[Suggested, ...] = ()
    drives: str = ""

    @property
    def real_tries(self) -> list[RealTry]:
        """What was recorded."""
        none = (np.nan, np.nan)
        return [
            RealTry(one.row, np.array(one.outcome_m or none)) for one in self.tries if one.recorded
        ]

    def record(self, number: int, outcome: tuple[float, float]) -> TransferState:
        """Return the state with the outcome of try `number`, from 1; NaN if it failed."""
        failed = not np.isfinite(outcome).all()
        one = replace(self.tries[number - 1], outcome_m=None if failed else outcome, failed=failed)
        tries = (*self.tries[: number - 1], one, *self.tries[number:])
        return replace(self, tries=tries)


def new_state(motion: RefinedMotion, dimension: int, config: TransferConfig) -> TransferState:
    """Return the state of a motion that nobody tried."""
    return TransferState(motion.plan.name, digest(motion.plan), config, no_plans(dimension))


def save_state(folder: Path, state: TransferState) -> None:
    """Write a state; whoever is stopped meanwhile leaves the old one."""
    make_folder(folder)
    # Before what says how many rows of it count.
    write_record(folder / "archive.npz", state.archive)
    write_json(
        folder / "state.json",
        {
            "version": _VERSION,
            "motion": state.motion,
            "key": state.key,
            "config": state.config.model_dump(mode="json"),
            "simulated": len(state.archive.points),
            "tries": [asdict(one) for one in state.tries],
            "drives": state.drives,
        },
    )


def load_state(folder: Path) -> TransferState:
    """Read what `save_state` wrote.

    Raises
    ------
    TransferError
        If the files are damaged.
    """
    path = folder / "state.json"
    try:
        content: dict[str, Any] = parse_json(path.read_bytes())
        archive = load_record(folder / "archive.npz")
        n = content["simulated"]
        if type(n) is not int or not 0 <= n <= len(archive.points):
            raise ValueError(f"simulated {n!r:.40}: expected at most {len(archive.points)}")
        archive = archive.first(n)
        return TransferState(
            motion=_name(content["motion"]),
            key=_name(content["key"]),
            config=TransferConfig(**content["config"]),
            archive=archive,
            tries=tuple(_suggested(one, len(archive.points)) for one in content["tries"]),
            drives=_name(content.get("drives", "")),
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise TransferError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None


def _suggested(content: dict[str, Any], n_plans: int) -> Suggested:
    outcome, row, failed = content["outcome_m"], content["row"], content["failed"]
    if type(row) is not int or not 0 <= row < n_plans or type(failed) is not bool:
        raise ValueError(f"row {row!r:.40}, failed {failed!r:.40}: expected one of {n_plans} plans")
    return Suggested(
        row=row,
        expected_m=_place(content["expected_m"]),
        outcome_m=None if outcome is None else _place(outcome),
        failed=failed,
    )


def _place(values: Any) -> tuple[float, float]:
    x, y = values
    place = float(x), float(y)
    if not all(abs(one) <= FARTHEST_M for one in place):
        raise ValueError(f"place {values!r:.60}: expected metres")
    return place


def _name(value: Any) -> str:
    fault = "is no text" if not isinstance(value, str) else fault_of_name(value)
    if fault is not None:
        raise ValueError(f"{value!r:.60} {fault}")
    return str(value)
