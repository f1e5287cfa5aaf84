"""Where actions of a stream may begin and end, and which of these places are final."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from besman.following.frames import FrameBuffer
from besman.stages.compose.borders import SNAP_S, give_way, merge_borders
from besman.stages.compose.valley_stream import ValleyStream


class CandidateStream:
    """Merges the borders of all arms and the valleys of hands, as `candidate_borders`.

    Parameters
    ----------
    brisk_m_s : mapping of str to float
        Hands that are looked at, with their brisk speed; none: borders of blocks alone.
    frames : FrameBuffer
        Gets the frames of the stream, before `add`.
    """

    def __init__(self, brisk_m_s: Mapping[str, float], frames: FrameBuffer) -> None:
        self.hands = tuple(brisk_m_s)
        self._frames = frames
        self._columns = [frames.markers.index(name) for name in self.hands]
        self._valleys = [ValleyStream(frames.rate_hz, speed) for speed in brisk_m_s.values()]
        # The last candidate that is final, and the last final border of blocks before valleys.
        self.final_row = 0
        self.final_border = 0

    def add(self, positions: npt.NDArray[np.float64]) -> None:
        """Take one frame, shape (M, 3), metres, hands seen."""
        for column, stream in zip(self._columns, self._valleys, strict=True):
            stream.add(positions[column])

    def finish(self) -> None:
        """End the stream."""
        for stream in self._valleys:
            stream.finish()

    def update(
        self, per_arm: Sequence[Sequence[int]], final_row: int, done: bool
    ) -> tuple[list[int], int]:
        """Take the present borders of every arm.

        Parameters
        ----------
        per_arm : sequence of sequences of int
            Rows after `final_border`, rising.
        final_row : int
            Up to it the borders of all arms are final.
        done : bool
            Whether the stream has ended; its end is a border then.

        Returns
        -------
        rows : list of int
            Candidates after the last one that was final before, rising.
        n_final : int
            How many of them are final now.
        """
        now, rate_hz = self._frames.n_rows, self._frames.rate_hz
        if now - self.final_row < 2 or now - self.final_border < 2:
            return [], 0
        blocks = merge_borders([[self.final_border, now], *per_arm])[1:-1]
        snap = SNAP_S * rate_hz
        slow = np.unique([row for one in self._valleys for row in one.valleys]).astype(np.int64)
        slow = slow[(slow > max(0, self.final_border - snap - 1)) & (slow < now)]
        if self._valleys and not done:
            # A valley to come may still displace a border before it.
            known = min(stream.known_row for stream in self._valleys)
            final_row = min(final_row, int(np.floor(known - snap)) - 1)
        kept = give_way(blocks, slow, rate_hz)
        merged = merge_borders([[self.final_row, now], kept, slow[slow > self.final_row]])
        rows = merged[1 : None if done else -1].tolist()
        n_final = sum(row <= final_row for row in rows)
        self.final_row = rows[n_final - 1] if n_final else self.final_row
        self.final_border = max([self.final_border, *blocks[blocks <= final_row].tolist()])
        self._forget(self.final_border - snap - 1)
        return rows, n_final

    def _forget(self, before: float) -> None:
        """Drop valleys that displace no border to come."""
        before = min(before, self.final_row)
        for stream in self._valleys:
            while stream.valleys and stream.valleys[0] < before:
                del stream.valleys[0]
