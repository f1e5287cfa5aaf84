"""Blocks and actions kept current while a person moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError, RecordingError, nearest
from besman.following.actions import ActionStream
from besman.following.arms import ArmStream, FollowedArm, OnlineSegmentation
from besman.following.foreseeing import BlockForecast
from besman.following.frames import FrameBuffer
from besman.following.pieces import Change, Piece
from besman.stages.compose.actions import LevelModel
from besman.stages.label.hold_last_sighting import GapHolder
from besman.stages.segment.stage import VmciOnlineConfig


@dataclass(frozen=True)
class FollowState:
    """What is known of a stream so far.

    Attributes
    ----------
    n_samples : int
        Samples so far.
    blocks : dict of tuple of Piece
        Blocks of each arm, in the order of time.
    actions : tuple of tuple of Piece
        Actions of each level, the lowest first.
    fitness : tuple of float
        Minus the mean uncertainty of the actions of each level.
    forecasts : tuple of BlockForecast
        What comes next, of each arm for which something can be foreseen.
    """

    n_samples: int
    blocks: dict[str, tuple[Piece, ...]]
    actions: tuple[tuple[Piece, ...], ...]
    fitness: tuple[float, ...]
    forecasts: tuple[BlockForecast, ...] = ()


class Follower:
    """Takes samples; keeps borders, labels and actions current.

    Each arm is segmented by online vMCI, or into movements and rests; what is most probable is
    known at once and may change, and becomes final when no sample to come can change it. With the
    scaling of the whole recording and without a horizon, the pieces after `finish` are those of
    exact vMCI (or of `besman.stages.segment.valley_vmci.find_movements`), `name_segments`,
    `candidate_borders` and `compose_levels` for the whole recording.

    Short gaps are bridged by holding the last sighting. Where a marker that is needed is not seen
    for longer, blocks and actions are ``unknown``, and the stream goes on.

    Parameters
    ----------
    markers : sequence of str, length M
        Names of the columns of a sample.
    rate_hz : float
        Samples per second.
    arms : sequence of FollowedArm
        What is segmented and named.
    levels : sequence of LevelModel
        Actions, the lowest first; none: blocks alone.
    segment : VmciOnlineConfig or ValleyOnlineConfig, optional
        How to segment; see `besman.following.arms.ArmStream`.
    brisk_m_s : mapping of str to float
        Where one of these hands is slow an action may begin or end too, not only at the borders of
        blocks; with their brisk speed, see `besman.stages.compose.borders.measure_brisk`.
    longest_blocks : int, optional
        Most blocks, or stretches between such places, in one action.
    horizon_blocks : int or None
        An action is final once so many of the level below follow it. None: no action is final
        before the end, and memory grows with the stream.
    longest_gap_s : float
        Gaps up to this length are bridged, seconds.
    steady_s : float
        A border that is not final is shown once the most probable ones up to it did not change
        for so long, seconds; 0: at once. Near the present they change with every sample.
    source : str
        Name of the stream, for errors.
    first_frame : int
        Frame number of the first sample, for errors.
    oriented : bool
        Whether samples hold orientations, as of a sensor suit.

    Raises
    ------
    BesmanError
        If there is no arm, two have one name, or a marker is missing that one needs.
    """

    def __init__(
        self,
        markers: Sequence[str],
        rate_hz: float,
        arms: Sequence[FollowedArm],
        levels: Sequence[LevelModel] = (),
        segment: OnlineSegmentation | None = None,
        *,
        brisk_m_s: Mapping[str, float] | None = None,
        longest_blocks: int | None = None,
        horizon_blocks: int | None = 20,
        longest_gap_s: float = 0.25,
        steady_s: float = 0.2,
        source: str = "stream",
        first_frame: int = 1,
        oriented: bool = False,
    ) -> None:
        of_actions = [*(name for level in levels for name in level.markers), *(brisk_m_s or ())]
        _check_names(arms, of_actions, markers, source)
        if not rate_hz > 0 or not longest_gap_s >= 0 or not steady_s >= 0:
            raise RecordingError(
                f"{source}: got {rate_hz:g} Hz, gaps up to {longest_gap_s:g} s and borders steady "
                f"for {steady_s:g} s; expected a positive rate and no negative time"
            )
        self._frames = FrameBuffer(markers, rate_hz, source, first_frame, 7 if oriented else 3)
        segment = VmciOnlineConfig() if segment is None else segment
        self._arms = [ArmStream(arm, segment, self._frames, steady_s) for arm in arms]
        self._actions = None
        if levels:
            self._actions = ActionStream(
                levels, longest_blocks, horizon_blocks, brisk_m_s or {}, self._frames
            )
        required = {name for arm in self._arms for name in arm.needed}
        required |= set(self._actions.needed if self._actions else ())
        # A length in seconds that is a whole number of samples must not lose one to rounding.
        longest = int(np.floor(longest_gap_s * rate_hz + 1e-6))
        self._gaps = GapHolder(markers, required, longest, source, self._frames.width)
        self._n_given = 0
        self._done = False

    @property
    def arms(self) -> tuple[FollowedArm, ...]:
        """What is followed."""
        return tuple(stream.arm for stream in self._arms)

    @property
    def state(self) -> FollowState:
        """All blocks and actions so far."""
        actions = self._actions
        return FollowState(
            self._n_given,
            {arm.arm.name: arm.ledger.pieces for arm in self._arms},
            tuple(ledger.pieces for ledger in actions.ledgers) if actions else (),
            actions.fitness if actions else (),
            tuple(
                arm.foreseer.forecast
                for arm in self._arms
                if arm.foreseer is not None and arm.foreseer.forecast is not None
            ),
        )

    def look_ahead(self) -> tuple[BlockForecast, ...]:
        """Return what comes next of each arm of which something else is expected than before.

        To be asked after every `push`; it looks again after every block, and every tenth of a
        second. What goes on when the stream ends has no forecast.
        """
        changed = [arm.foreseer for arm in self._arms if arm.foresee()]
        return tuple(
            one.forecast for one in changed if one is not None and one.forecast is not None
        )

    def push(self, samples: npt.ArrayLike) -> tuple[Change, ...]:
        """Take one sample or several.

        Parameters
        ----------
        samples : array, shape (M, 3) or (k, M, 3), or with 7 for 3 if `oriented`
            Positions in the laboratory frame (z up), metres, and unit quaternions (w, x, y, z),
            body2lab; NaN where a marker is not seen.

        Returns
        -------
        tuple of Change
            Of the blocks of each arm, then of the actions of each level.

        Raises
        ------
        RecordingError
            If the shape does not fit, a position is infinite, or `finish` was called.
        LabellingError
            If a marker that is needed is not seen at the start for longer than gaps are bridged.
        SegmentationError
            If the scaling is to be measured and no hand moves.
        RecognitionError
            If features cannot be made of a block.
        """
        for sample in self._check(samples):
            self._n_given += 1
            for held in self._gaps.take(sample):
                self._frames.add(held)
                for arm in self._arms:
                    arm.add(held.values[:, :3])
                if self._actions is not None:
                    self._actions.candidates.add(held.values[:, :3])
        return self._update()

    def finish(self) -> tuple[Change, ...]:
        """End the stream: everything becomes final.

        Returns
        -------
        tuple of Change
            As `push`.

        Raises
        ------
        BesmanError
            If there were too few samples, or as in `push`.
        """
        self._refuse_more()
        self._gaps.check_finished()
        for arm in self._arms:
            arm.finish()
        if self._actions is not None:
            self._actions.candidates.finish()
        self._done = True
        return self._update()

    def _update(self) -> tuple[Change, ...]:
        """Bring blocks and actions to the present."""
        changes = [change for arm in self._arms for change in arm.update()]
        final_row = min(arm.final_row for arm in self._arms)
        if self._actions is not None:
            after = self._actions.candidates.final_border
            borders = [arm.borders_after(after) for arm in self._arms]
            changes += self._actions.update(borders, final_row, self._done)
            final_row = min(final_row, self._actions.final_row)
        self._frames.forget(final_row)
        return tuple(changes)

    def _check(self, given: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return samples, shape (k, M, 3) or (k, M, 7)."""
        self._refuse_more()
        values = np.asarray(given, dtype=np.float64)
        samples = values[np.newaxis] if values.ndim == 2 else values
        n, width = len(self._frames.markers), self._frames.width
        if samples.ndim != 3 or samples.shape[1:] != (n, width):
            raise RecordingError(
                f"{self._frames.source}: sample {self._n_given}: got shape {values.shape}; "
                f"expected ({n}, {width}), or (k, {n}, {width}) for k samples"
            )
        if np.isinf(samples).any():
            row, column, _ = np.argwhere(np.isinf(samples))[0]
            raise RecordingError(
                f"{self._frames.source}: sample {self._n_given + row}: marker "
                f"{self._frames.markers[column]!r} is at infinity; expected metres, or NaN where "
                "it is not seen"
            )
        return samples

    def _refuse_more(self) -> None:
        if self._done:
            raise RecordingError(
                f"{self._frames.source}: finished after {self._n_given} samples; start a new one"
            )


def _check_names(
    arms: Sequence[FollowedArm], needed: Sequence[str], markers: Sequence[str], source: str
) -> None:
    """Refuse arms that cannot be followed, and markers that are not there."""
    names = [arm.name for arm in arms]
    if not arms or len(set(names)) < len(names):
        raise RecognitionError(
            f"{source}: got arms {', '.join(names) or 'none'}; expected one or more, each with a "
            "name of its own"
        )
    for name in (*(name for arm in arms for name in arm.hands), *needed):
        if name not in markers:
            raise RecognitionError(f"{source}: no marker {name!r}; {nearest(name, markers)}")
