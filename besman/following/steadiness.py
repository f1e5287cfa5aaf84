"""Most probable borders that have been so for a while: the last ones change with every sample."""

from __future__ import annotations

from collections.abc import Sequence


class SteadyBorders:
    """Lets a border pass once it, and all before it, did not change for a while.

    A border that has passed stays until others were steady in its place, or it was not among the
    most probable ones for as long.

    Parameters
    ----------
    patience : int
        Rows that are a while; 0 lets everything pass.
    """

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self._seen: list[int] = []
        # Row since which each border, and all before it, were as they are.
        self._since: list[int] = []
        self._differs_since: int | None = None
        self.shown: list[int] = []

    def update(self, rows: Sequence[int], final_row: int, now: int) -> list[int]:
        """Take the present borders.

        Parameters
        ----------
        rows : sequence of int
            Most probable borders after the last final one, rising.
        final_row : int
            The last final border.
        now : int
            Rows so far.

        Returns
        -------
        list of int
            Borders that may be shown, rising, at least two rows after the last final one.
        """
        gone = sum(row <= final_row for row in self._seen)
        seen, since = self._seen[gone:], self._since[gone:]
        same = _count_common(seen, rows)
        self._seen, self._since = list(rows), since[:same] + [now] * (len(rows) - same)
        n_steady = sum(now - row >= self._patience for row in self._since)
        shown = [row for row in self.shown if row >= final_row + 2]
        common = _count_common(shown, rows)
        if n_steady > common or common == len(shown):
            shown = self._seen[: max(n_steady, common)]
            self._differs_since = None
        elif self._differs_since is None:
            self._differs_since = now
        elif now - self._differs_since >= self._patience:
            shown = shown[:common]
            self._differs_since = None
        self.shown = shown
        return shown


def _count_common(one: Sequence[int], two: Sequence[int]) -> int:
    """Return how many first entries are the same."""
    n = 0
    while n < min(len(one), len(two)) and one[n] == two[n]:
        n += 1
    return n
