"""Two steps around the selection: what actions there are, and what happens in each of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.config.stage import Items, Truth, Work
from besman.exceptions import MappingError, nearest
from besman.person.marker_set import MarkerSet
from besman.records import (
    BlockDemonstration,
    Failure,
    HandTrajectory,
    LabelledRecording,
    LabelledSegments,
)
from besman.stages.select.block_grammar import (
    BlockRun,
    blocks_within,
    check_grammar,
    find_beginning,
    find_sequence,
    join_blocks,
)
from besman.stages.select.finger_frame import turn_to_fingers
from besman.stages.select.hand_motion import (
    call_rests,
    hand_motion,
    hand_prefix,
    refuse_both_hands,
)
from besman.stages.select.handled_objects import ObjectTrack, measure_opening, track_object
from besman.stages.select.holds import find_holds
from besman.stages.select.stage import SelectConfig

FloatArray = npt.NDArray[np.float64]

# Beside an action this much of the recording tells where an object stood, and where it stands.
_MARGIN_S = 1.0


@dataclass(frozen=True)
class FindActions:
    """Finds where blocks make the actions of `select.actions`, or takes manual ones.

    Attributes
    ----------
    config : SelectConfig
    """

    config: SelectConfig

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        blocks: tuple[LabelledSegments, ...],
        manual: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> tuple[LabelledSegments, ...]:
        """Return the actions of each recording.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
        blocks : tuple of LabelledSegments
            Of each recording.
        manual : tuple of LabelledSegments
            Manual segments on the layer ``actions`` of some recordings; looked at if the recipe
            has no sequence for the action.
        work : Work

        Raises
        ------
        MappingError
            If an action has a block that no recording has, or the action that is selected is
            nowhere.
        """
        grammar = self.config.actions
        name, *others = self.config.wanted
        known = sorted({label for found in blocks for label in found.labels})
        check_grammar(grammar, known)
        if name in grammar:
            actions = tuple(
                self._by_grammar(call_rests(recording, found, self.config.arm))
                for recording, found in zip(recordings, blocks, strict=True)
            )
            labels = {label for found in actions for label in found.labels}
            for action in (name, *others):
                if action not in labels:
                    raise MappingError(
                        f"select.actions.{action}: {', '.join(grammar[action])} follow each other "
                        f"in none of {len(blocks)} recordings"
                    )
            if work.notes is not None:
                for found, own in zip(blocks, actions, strict=True):
                    work.notes.failures += self._cut_off(found, own)
            return actions
        by_source = {one.source: one for one in manual}
        known = sorted({*grammar, *(label for one in manual for label in one.labels)})
        if name not in known:
            raise MappingError(
                f"select.action: got {name!r}; {nearest(name, known)} (select.actions, "
                "compose.levels or segments on the layer 'actions')"
            )
        return tuple(_by_hand(found, by_source.get(found.source), name) for found in blocks)

    def _by_grammar(self, blocks: LabelledSegments) -> LabelledSegments:
        """Find the sequences of a recording's blocks that are actions, in the order of time."""
        joined = join_blocks(blocks)
        rows = sorted(
            (int(run.bounds[0, 0]), int(run.bounds[-1, 1]), action)
            for action, sequence in self.config.actions.items()
            for run in find_sequence(joined, sequence)
        )
        return _as_segments(blocks, rows)

    def _cut_off(self, blocks: LabelledSegments, actions: LabelledSegments) -> list[Failure]:
        """Say which of the wanted actions has begun where a recording ends."""
        joined, told = join_blocks(blocks), []
        # What ends another action is no beginning.
        last = int(actions.bounds[:, 1].max(initial=0))
        for action in self.config.wanted:
            sequence = self.config.actions[action]
            n = find_beginning(joined, sequence)
            if n and joined.bounds[-n, 0] >= last:
                told.append(
                    Failure(
                        f"{blocks.source}: {action}",
                        f"begins at {joined.bounds[-n, 0] / blocks.rate_hz:.2f} s, and the "
                        f"recording ends before {sequence[n]}",
                    )
                )
        return told

    def items(self, recordings: Any, blocks: tuple[LabelledSegments, ...], *records: Any) -> Items:
        """Count the blocks."""
        return Items(sum(len(found.labels) for found in blocks), "blocks")

    def figures(
        self, actions: tuple[LabelledSegments, ...], truth: Truth, *records: Any
    ) -> dict[str, Any]:
        """Return how many of each action there are."""
        labels = [label for found in actions for label in found.labels]
        return {"counts": {name: labels.count(name) for name in sorted(set(labels))}}


def _by_hand(
    blocks: LabelledSegments, manual: LabelledSegments | None, name: str
) -> LabelledSegments:
    """Return the manual actions of a recording with a name."""
    if manual is None:
        return _as_segments(blocks, [])
    rows = zip(manual.bounds.tolist(), manual.labels, strict=True)
    return _as_segments(blocks, [(*bounds, label) for bounds, label in rows if label == name])


def _as_segments(like: LabelledSegments, rows: list[tuple[int, int, str]]) -> LabelledSegments:
    """Return rows and labels as segments of the same recording."""
    return LabelledSegments(
        np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2),
        tuple(label for _, _, label in rows),
        np.zeros(len(rows)),
        like.rate_hz,
        like.source,
        like.first_frame,
    )


@dataclass(frozen=True)
class DivideActions:
    """Divides selected actions into their blocks, and tells what their objects do.

    Attributes
    ----------
    config : SelectConfig
    """

    config: SelectConfig

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        blocks: tuple[LabelledSegments, ...],
        actions: tuple[LabelledSegments, ...],
        hands: tuple[HandTrajectory, ...],
        markers: MarkerSet,
        work: Work = Work(),
    ) -> tuple[BlockDemonstration, ...]:
        """Return a demonstration for each hand's way through an action.

        Parameters
        ----------
        recordings, blocks, actions : tuple
            Of each recording; blocks as recognized, actions as `hands` were selected from.
        hands : tuple of HandTrajectory
            Of `SelectConfig.run`.
        markers : MarkerSet
            Its objects are looked for.
        work : Work

        Raises
        ------
        MappingError
            If every action is left out: there is no block in it, an object is out of sight, or is
            still held where the action ends.
        """
        sources = [recording.source for recording in recordings]

        def divide(hand: HandTrajectory) -> BlockDemonstration:
            source, _, row = hand.name.rpartition(":")
            at = sources.index(source)
            start = int(actions[at].bounds[int(row), 0])
            bounds = (start, start + 1 + round(float(hand.time[-1]) * recordings[at].rate_hz))
            found = call_rests(recordings[at], blocks[at], self.config.arm)
            inside = blocks_within(join_blocks(found), *bounds)
            if not inside.labels:
                raise MappingError(f"{hand.name}: no block lies within the action {hand.label!r}")
            return self._divide(recordings[at], bounds, inside, hand, markers)

        here = replace(work, jobs=1, workers=None)
        return tuple(here.map(divide, hands, name=lambda hand: hand.name))

    def _divide(
        self,
        recording: LabelledRecording,
        bounds: tuple[int, int],
        inside: BlockRun,
        hand: HandTrajectory,
        markers: MarkerSet,
    ) -> BlockDemonstration:
        """Divide one action."""
        start, stop = bounds
        rate_hz = recording.rate_hz
        margin = round(_MARGIN_S * rate_hz)
        wide = max(0, start - margin), min(len(recording.time), stop + margin)
        inner = slice(start - wide[0], stop - wide[0])
        things = {
            thing: own
            for thing, own in markers.objects.items()
            if thing != self.config.object and set(own) <= set(recording.markers)
        }
        tracks: dict[str, ObjectTrack] = {}
        holds: list[tuple[float, float, str]] = []
        way, hand2lab = hand_motion(recording, wide, self.config.arm)
        for thing, own in things.items():
            gap_s = self.config.longest_gap_s
            track = track_object(recording, wide, thing, own, gap_s, hand.name)
            tracks[thing] = ObjectTrack(track.positions[inner], track.headings[inner])
            for grasp, release in find_holds(way, track.positions, rate_hz, hand2lab) + wide[0]:
                if grasp < stop and release > start:
                    _check_release(hand, thing, grasp, release, (start, stop), rate_hz)
                    holds.append(((grasp - start) / rate_hz, (release - start) / rate_hz, thing))
                    held = (grasp - wide[0], release - wide[0])
                    side = self.config.arm
                    refuse_both_hands(recording, wide, held, (thing, track), side, hand.name)
        holds.sort()
        rows = [(start + round(on * rate_hz), start + round(off * rate_hz)) for on, off, _ in holds]
        prefix = hand_prefix(recording, self.config.arm)
        turned = turn_to_fingers(hand, recording, (way, hand2lab), wide[0], rows, prefix)
        return BlockDemonstration(
            turned,
            inside.labels,
            np.clip((inside.bounds - start) / rate_hz, 0.0, hand.time[-1]),
            tuple(tracks),
            *_in_back_frame(recording, bounds, hand, list(tracks.values()), self.config),
            np.array([hold[:2] for hold in holds]).reshape(-1, 2),
            tuple(hold[2] for hold in holds),
            _resample(
                measure_opening(recording, bounds, prefix),
                rate_hz,
                hand.time,
            ),
        )

    def items(
        self, recordings: Any, blocks: Any, actions: Any, hands: tuple[HandTrajectory, ...], *_: Any
    ) -> Items:
        """Count the actions."""
        return Items(len(hands), "actions")

    def figures(
        self, found: tuple[BlockDemonstration, ...], truth: Truth, *records: Any
    ) -> dict[str, Any]:
        """Return the blocks, grasps and releases of each action."""
        return {
            "n_demonstrations": len(found),
            "demonstrations": {
                one.name: {
                    "blocks": list(one.labels),
                    "borders_s": one.bounds_s.tolist(),
                    "holds": [
                        {
                            "object": thing,
                            "grasp_s": float(grasp),
                            "grasp_in": one.labels[one.block_at(grasp)],
                            "release_s": float(release),
                            "release_in": one.labels[one.block_at(release)],
                        }
                        for thing, (grasp, release) in zip(one.held, one.holds_s, strict=True)
                    ],
                }
                for one in found
            },
        }


def _check_release(
    hand: HandTrajectory,
    thing: str,
    grasp: int,
    release: int,
    action: tuple[int, int],
    rate_hz: float,
) -> None:
    """Refuse an action at whose end something is still held."""
    if release > action[1]:
        raise MappingError(
            f"{hand.name}: {thing} is grasped at {(grasp - action[0]) / rate_hz:.2f} s and not "
            f"released before the action ends at {(action[1] - action[0]) / rate_hz:.2f} s"
        )


def _in_back_frame(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    hand: HandTrajectory,
    tracks: list[ObjectTrack],
    config: SelectConfig,
) -> tuple[FloatArray, FloatArray]:
    """Return positions (T, O, 3) and headings (T, O) of objects in the back frame of a hand."""
    from besman.stages.select.body_points import GapLimits
    from besman.stages.select.hand_trajectory import find_back_frame

    gaps = GapLimits(config.longest_gap_s, config.longest_rigid_gap_s)
    back2lab, origin = find_back_frame(
        recording, bounds, config.arm, hand.name, config.cutoff_hz, gaps
    )
    turn = np.arctan2(back2lab[1, 0], back2lab[0, 0])
    rate_hz, time = recording.rate_hz, hand.time
    positions = np.empty((len(time), len(tracks), 3))
    headings = np.empty((len(time), len(tracks)))
    for k, track in enumerate(tracks):
        positions[:, k] = (_resample(track.positions, rate_hz, time) - origin) @ back2lab
        headings[:, k] = _resample(track.headings, rate_hz, time) - turn
    return positions, headings


def _resample(values: FloatArray, rate_hz: float, time: FloatArray) -> FloatArray:
    """Interpolate values, shape (T, ...), of samples from time 0 on, along straight lines."""
    columns = values.reshape(len(values), -1)
    rows = np.arange(len(values)) / rate_hz
    found = np.stack([np.interp(time, rows, column) for column in columns.T], axis=1)
    return found.reshape(len(time), *values.shape[1:])
