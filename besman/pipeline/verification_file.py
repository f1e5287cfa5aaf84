"""What a run folder says of its motions in a second engine; see `besman.pipeline.verified_run`."""

from __future__ import annotations

from typing import Any

from besman.exceptions import RunError
from besman.pipeline.derived_files import stale_files
from besman.pipeline.stored_run import StoredRun, read_object

VERIFIED = "verify.json"
"""What is written into the run folder."""

_KEYS = {"outcome_m", "miss_m", "success", "failure"}


def read_verification(run: StoredRun) -> dict[str, Any] | None:
    """Read what a run's motions do in a second engine; None if that is not known of these."""
    path = run.folder / VERIFIED
    if not path.is_file() or VERIFIED in stale_files(run):
        return None
    results = read_object(path)
    try:
        engine = results["engine"]
        whole = isinstance(results[engine]["within"], dict) and bool(results["motions"])
        whole = whole and all(one[engine].keys() == _KEYS for one in results["motions"])
    except (KeyError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise RunError(f"{path}: is not as besman writes it; besman verify writes it anew")
    return results
