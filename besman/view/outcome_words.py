"""What became of a motion, in the same words on every page."""

from __future__ import annotations

import numpy as np

from besman.records import RefinedMotion


def outcome_words(miss_m: float, failure: str) -> str:
    """Say how far off the target an episode ended, and what went wrong in it.

    Parameters
    ----------
    miss_m : float
        Metres; NaN or infinite without an outcome.
    failure : str
        "" if nothing went wrong.
    """
    if not np.isfinite(miss_m):
        return failure or "no outcome"
    words = f"{100 * miss_m:.1f} cm off the target"
    return f"{words}, but {failure}" if failure else words


def with_imitation(after: str, before: str) -> str:
    """Say what became of a motion in the end and as it was imitated."""
    return f"{after} (imitated: {before})"


def motion_words(motion: RefinedMotion) -> str:
    """Say what became of a refined motion, and of its imitation; and who went on, if one had to.

    Parameters
    ----------
    motion : RefinedMotion
    """
    after = outcome_words(motion.miss, motion.failure_after)
    words = with_imitation(after, outcome_words(motion.miss_before, motion.failure))
    if motion.handed_over:
        words += f"; CMA-ES went on, as {motion.handed_over}"
    return words
