"""Which block comes next: a Markov model of variable order over sequences of labels."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError

FloatArray = npt.NDArray[np.float64]

BEGIN = ""
"""What stands before the first label of a sequence."""


class BlockOrder:
    """Counts what followed the last labels, the longest context that was seen first.

    The probability of a label `a` after a context `s` is interpolated with that after the shorter
    context `s'`, down to all labels being as probable:

    ``P(a | s) = (n(s a) + t(s) P(a | s')) / (n(s) + t(s))``

    with `n` the counts and `t(s)` the number of different labels that followed `s`: what followed
    often and was always the same is trusted most.

    Parameters
    ----------
    sequences : sequence of sequences of str
        Labels in the order of time; each sequence begins where a recording does.
    labels : sequence of str, optional
        Those that are foreseen; all that occur if not given. Others are context alone.
    longest_context : int
        Labels looked back at, the beginning of a sequence among them.

    Attributes
    ----------
    labels : tuple of str, length K
        Sorted.

    Raises
    ------
    RecognitionError
        If there is nothing to foresee, or the context is negative.

    References
    ----------
    I. H. Witten, T. C. Bell: The zero-frequency problem, IEEE Transactions on Information Theory
    37(4), 1991, method C, doi:10.1109/18.87000.
    """

    def __init__(
        self,
        sequences: Sequence[Sequence[str]],
        labels: Sequence[str] | None = None,
        longest_context: int = 3,
    ) -> None:
        occurring = {label for sequence in sequences for label in sequence}
        self.labels = tuple(sorted(occurring if labels is None else set(labels)))
        if not self.labels or longest_context < 0:
            raise RecognitionError(
                f"order of blocks: got {len(self.labels)} labels and a context of "
                f"{longest_context}; expected one label or more, and a context of 0 or more"
            )
        self.longest_context = longest_context
        self._columns = {label: k for k, label in enumerate(self.labels)}
        self._followers: defaultdict[tuple[str, ...], Counter[int]] = defaultdict(Counter)
        for sequence in sequences:
            for k, label in enumerate(sequence):
                if label in self._columns:
                    context = self._context(sequence[:k])
                    for length in range(len(context) + 1):
                        key = context[len(context) - length :]
                        self._followers[key][self._columns[label]] += 1

    def probabilities(self, before: Sequence[str]) -> FloatArray:
        """Return the probability of each label to come next.

        Parameters
        ----------
        before : sequence of str
            Labels from the beginning of the sequence, the last one last.

        Returns
        -------
        array, shape (K,)
            By the order of `labels`; the sum is 1.
        """
        context = self._context(before)
        found = np.full(len(self.labels), 1.0 / len(self.labels))
        for length in range(len(context) + 1):
            followers = self._followers.get(context[len(context) - length :])
            if followers is None:
                break
            n, different = followers.total(), len(followers)
            found *= different / (n + different)
            for column, count in followers.items():
                found[column] += count / (n + different)
        return found

    def _context(self, before: Sequence[str]) -> tuple[str, ...]:
        """Return the last labels, with the beginning before the first one."""
        length = self.longest_context
        return (BEGIN, *before)[-length:] if length else ()
