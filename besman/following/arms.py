"""One arm of a stream: its borders, and the names of its blocks."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.classifiers.novelty import UNKNOWN
from besman.exceptions import SegmentationError
from besman.following.foreseeing import BlockForeseer
from besman.following.foresight import Foresight
from besman.following.frames import FrameBuffer
from besman.following.pieces import Change, Ledger, Piece
from besman.following.steadiness import SteadyBorders
from besman.stages.recognize.features import needed_markers
from besman.stages.recognize.model import RecognitionModel, name_segments
from besman.stages.segment.signals import Scaling, measure_scaling, resample
from besman.stages.segment.stage import HAND_SHAPE, ValleyOnlineConfig, VmciOnlineConfig
from besman.stages.segment.valley_online import OnlineMovements, Pace, measure_pace
from besman.stages.segment.valley_vmci import EVIDENCE_HZ
from besman.stages.segment.vmci import VmciModel
from besman.stages.segment.vmci_online import OnlineVmci

FloatArray = npt.NDArray[np.float64]

_CALIBRATION_S = 10.0

OnlineSegmentation = VmciOnlineConfig | ValleyOnlineConfig
"""The methods that go on sample by sample."""


@dataclass(frozen=True, eq=False)
class FollowedArm:
    """What is followed of one arm, or of both as one.

    Attributes
    ----------
    name : str
    hands : tuple of str, length m
        Markers whose speed is bell-shaped; their movement is segmented.
    model : RecognitionModel
        Names the blocks.
    scaling : Scaling or Pace, optional
        Of earlier movements of `hands`, at the rate of the segmentation: a pace where movements and
        rests are found (`ValleyOnlineConfig`). If not given, it is measured on the first seconds of
        the stream, which are segmented once they are over.
    foresight : Foresight, optional
        Tells what comes next; nothing is foreseen if not given.
    """

    name: str
    hands: tuple[str, ...]
    model: RecognitionModel
    scaling: Scaling | Pace | None = None
    foresight: Foresight | None = None


class ArmStream:
    """Segments one arm and names its blocks, sample by sample.

    Parameters
    ----------
    arm : FollowedArm
    segment : VmciOnlineConfig or ValleyOnlineConfig
        How to segment; its markers do not matter. Without a border probability one border a second
        is expected, without `calibration_s` the scaling is measured on 10 s.
    frames : FrameBuffer
        Gets the frames of the stream, before `add`.
    steady_s : float
        Borders that are not final are taken once they did not change for so long, seconds.

    Raises
    ------
    RecognitionError
        If markers are missing that the model needs.
    SegmentationError
        If a parameter is out of its range.
    """

    def __init__(
        self, arm: FollowedArm, segment: OnlineSegmentation, frames: FrameBuffer, steady_s: float
    ) -> None:
        self.arm, self._segment, self._frames = arm, segment, frames
        recipe = arm.model.recipe
        body = needed_markers(frames.markers, recipe.features, recipe.markers, frames.source)
        self.needed = tuple(dict.fromkeys((*arm.hands, *body)))
        self._hands = [frames.markers.index(n) for n in arm.hands if n in frames.markers]
        self._columns = [frames.markers.index(n) for n in self.needed if n in frames.markers]
        wanted_hz = segment.rate_hz if isinstance(segment, VmciOnlineConfig) else EVIDENCE_HZ
        self._rate_hz = min(wanted_hz, frames.rate_hz)
        self._early: list[FloatArray] = []
        self._online = None if arm.scaling is None else self._start(arm.scaling)
        self._names: dict[tuple[int, int], tuple[str, float]] = {}
        self._final = [0]
        self._open: list[int] = []
        self._steady = SteadyBorders(round(steady_s * frames.rate_hz))
        self.ledger = Ledger()
        self._done = False
        self.foreseer: BlockForeseer | None = None
        if arm.foresight is not None:
            self.foreseer = BlockForeseer(
                arm.name, arm.foresight, frames.markers, frames.rate_hz, frames.source
            )

    @property
    def final_row(self) -> int:
        """The last final border."""
        return self._final[-1]

    def borders_after(self, row: int) -> list[int]:
        """Return the most probable borders after a row, as of the last `update`."""
        return [*self._final[bisect_right(self._final, row) :], *self._open]

    def add(self, positions: FloatArray) -> None:
        """Take one frame, shape (M, 3), metres, hands seen."""
        sample = positions[self._hands]
        if self._online is not None:
            self._final += self._online.update(sample)
            return
        self._early.append(sample)
        if len(self._early) >= self._calibration_rows:
            self._calibrate()

    def finish(self) -> None:
        """End the stream; its end is a border."""
        if self._online is None:
            self._calibrate()
        assert self._online is not None
        self._final += [*self._online.finish(), self._frames.n_rows]
        self._done = True

    def update(self) -> list[Change]:
        """Name the blocks that are new; return what changed."""
        before = self._open
        now, final = self._frames.n_rows, self._final[-1]
        self._open = [] if self._done else self._steady.update(self._pending(), final, now)
        known = self._final[self.ledger.n_final :]
        if len(known) == 1 and self._open == before:
            return []
        pieces = [self._name(*rows, True) for rows in pairwise(known)]
        pieces += [self._name(*rows, False) for rows in pairwise([known[-1], *self._open])]
        self._names = {(one.start, one.end): (one.label, one.uncertainty) for one in pieces}
        return self.ledger.update(pieces)

    def foresee(self) -> bool:
        """Look ahead; tell whether something else is expected than before."""
        n_rows, pieces = self._frames.n_rows, self.ledger.pieces
        if self.foreseer is None or self._done or not self.foreseer.is_due(len(pieces), n_rows):
            return False
        start = pieces[-1].end if pieces else 0
        if n_rows <= start:
            return False
        blocks = [(piece.start, piece.end, piece.label) for piece in pieces]
        columns, first = np.array(self.foreseer.columns), start
        ahead = max(self._frames.first_row, start - self.foreseer.n_ahead)
        if not self._frames.was_lost(ahead, start, columns):
            first = ahead
        positions = self._frames.cut(first, n_rows).positions
        if self._frames.was_lost(start, n_rows, columns):
            positions = positions[: start - first]
        return self.foreseer.update(blocks, n_rows, positions, first)

    def _pending(self) -> list[int]:
        """Return borders that are not final, at least two rows apart and before the present."""
        if self._online is None:
            return []
        rows = [self._final[-1]]
        for row in self._online.pending:
            if row - rows[-1] >= 2 and self._frames.n_rows - row >= 2:
                rows.append(row)
        return rows[1:]

    def _name(self, start: int, end: int, final: bool) -> Piece:
        if (start, end) not in self._names:
            label, uncertainty = UNKNOWN, float("inf")
            if not self._frames.was_lost(start, end, np.array(self._columns)):
                block = self._frames.cut(start, end)
                labels, values = name_segments(self.arm.model, block, [[0, end - start]])
                label, uncertainty = labels[0], float(values[0])
            self._names[start, end] = (label, uncertainty)
        return Piece("block", self.arm.name, start, end, *self._names[start, end], final)

    def _start(self, scaling: Scaling | Pace) -> OnlineVmci | OnlineMovements:
        if isinstance(self._segment, VmciOnlineConfig):
            assert isinstance(scaling, Scaling)
            return OnlineVmci(
                scaling,
                self._segment.border_probability or 1.0 / max(self._rate_hz, 2.0),
                self._frames.rate_hz,
                self._rate_hz,
                self._segment.longest_s,
                VmciModel(n_centres=self._segment.n_centres),
            )
        assert isinstance(scaling, Pace)
        return OnlineMovements(scaling, self._frames.rate_hz, self._segment.longest_s, HAND_SHAPE)

    @property
    def _calibration_rows(self) -> int:
        seconds = self._segment.calibration_s or _CALIBRATION_S
        return max(2, round(seconds * self._frames.rate_hz))

    def _calibrate(self) -> None:
        """Measure the scaling on what came so far, and segment that."""
        source, n = self._frames.source, len(self._early)
        if n < 2:
            raise SegmentationError(f"{source}: got {n} samples; expected at least 2")
        paths = np.stack(self._early)
        samples = resample(np.arange(n) / self._frames.rate_hz, paths, self._rate_hz)
        if len(samples) < 2:
            raise SegmentationError(
                f"{source}: lasts {n / self._frames.rate_hz:.3g} s, which is 1 sample at "
                f"{self._rate_hz:g} Hz; expected at least 2"
            )
        scaling: Scaling | Pace = measure_scaling(samples)
        if isinstance(self._segment, ValleyOnlineConfig):
            scaling = measure_pace(np.arange(n) / self._frames.rate_hz, paths, HAND_SHAPE)
        if not np.isfinite(scaling.change).any():
            raise SegmentationError(
                f"{source}: {', '.join(self.arm.hands)} did not move in the first "
                f"{n / self._frames.rate_hz:.3g} s, on which the scaling is measured; expected "
                "movement, a longer calibration_s, or the scaling of earlier movements"
            )
        self._online, self._early = self._start(scaling), []
        for sample in paths:
            self._final += self._online.update(sample)
