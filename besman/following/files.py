"""Following a recording as if it were a stream."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import ConfigError
from besman.following.follower import Follower
from besman.following.foreseeing import BlockForecast
from besman.following.json_events import content_of_forecast, content_of_piece
from besman.following.pieces import Change, Piece
from besman.following.plans import FollowPlan, label_stream, make_follower
from besman.io.recordings.formats import read_recording
from besman.records import FloatArray, LabelledRecording


class Replay:
    """A recording that is given to a follower sample by sample.

    Parameters
    ----------
    path : Path
        The recording.
    plan : FollowPlan
        What is followed.
    speed : float, optional
        Seconds of the recording in a second; as fast as can be if not given.
    horizon_blocks, steady_s
        See `besman.following.follower.Follower`.

    Attributes
    ----------
    recording : LabelledRecording
        What was read.
    follower : Follower
    seconds : list of float
        Time that each sample took.
    changes : list of (float, Change)
        What changed so far, with the time since the start of the recording, seconds.
    forecasts : list of BlockForecast
        Whenever something else was expected to come next.

    Raises
    ------
    BesmanError
        If the recording cannot be read or followed, or the speed is not positive.
    """

    def __init__(
        self,
        path: Path,
        plan: FollowPlan,
        speed: float | None = None,
        horizon_blocks: int | None = 20,
        steady_s: float = 0.2,
    ) -> None:
        if speed is not None and not speed > 0:
            raise ConfigError(
                f"--speed: got {speed:g}; expected a positive factor, 1 for real time"
            )
        self.recording: LabelledRecording = label_stream(plan, read_recording(path))
        self.follower: Follower = make_follower(plan, self.recording, horizon_blocks, steady_s)
        self.seconds: list[float] = []
        self.changes: list[tuple[float, Change]] = []
        self.forecasts: list[BlockForecast] = []
        self._speed = speed

    def run(self) -> Iterator[tuple[float, Change | BlockForecast]]:
        """Give every sample, then the end; yield what changes or is foreseen, with the time, s."""
        rate_hz, begin = self.recording.rate_hz, time.perf_counter()
        for row, sample in enumerate(self._samples()):
            if self._speed is not None:
                due = begin + row / (rate_hz * self._speed)
                time.sleep(max(0.0, due - time.perf_counter()))
            start = time.perf_counter()
            changes = self.follower.push(sample)
            forecasts = self.follower.look_ahead()
            self.seconds.append(time.perf_counter() - start)
            yield from self._keep((row + 1) / rate_hz, changes)
            self.forecasts += forecasts
            for forecast in forecasts:
                yield (row + 1) / rate_hz, forecast
        yield from self._keep(len(self.recording.time) / rate_hz, self.follower.finish())

    def content(self) -> dict[str, Any]:
        """Return what was followed, for JSON: the final state, and every change on the way."""
        state = self.follower.state
        return {
            "recording": self.recording.source,
            "rate_hz": self.recording.rate_hz,
            "n_samples": state.n_samples,
            "blocks": {
                arm: [self._describe(piece) for piece in pieces]
                for arm, pieces in state.blocks.items()
            },
            "actions": [[self._describe(piece) for piece in level] for level in state.actions],
            "fitness": list(state.fitness),
            "changes": [
                {"time_s": at, "status": change.status, **self._describe(change.piece)}
                for at, change in self.changes
            ],
            "forecasts": [
                content_of_forecast(one, self.recording.rate_hz) for one in self.forecasts
            ],
            "seconds_per_sample": {
                "median": float(np.median(self.seconds)),
                "p99_9": float(np.percentile(self.seconds, 99.9)),
            },
        }

    def summary(self) -> str:
        """Return one line on what was found and how long it took."""
        state, rate_hz = self.follower.state, self.recording.rate_hz
        counts = [f"{len(pieces)} blocks ({arm})" for arm, pieces in state.blocks.items()]
        counts += [f"{len(level)} actions" for level in state.actions]
        known = _delays(self.changes, rate_hz, ("new", "final"))
        final = _delays(self.changes, rate_hz, ("final",))
        median, high = 1e3 * np.percentile(self.seconds, (50, 99.9))
        return (
            f"{state.n_samples / rate_hz:.2f} s: {', '.join(counts)}; a block is known "
            f"{np.median(known):.2f} s and final {np.median(final):.2f} s after its end (medians); "
            f"a sample took {median:.2f} ms (median), {high:.2f} ms (99.9th percentile)"
        )

    def _samples(self) -> FloatArray:
        recording = self.recording
        if recording.orientations is None:
            return recording.positions
        samples: FloatArray = np.concatenate([recording.positions, recording.orientations], axis=2)
        return samples

    def _keep(self, at: float, changes: tuple[Change, ...]) -> Iterator[tuple[float, Change]]:
        self.changes += [(at, change) for change in changes]
        yield from self.changes[len(self.changes) - len(changes) :]

    def _describe(self, piece: Piece) -> dict[str, Any]:
        return content_of_piece(piece, self.recording.rate_hz, self.recording.first_frame)


def _delays(
    changes: list[tuple[float, Change]], rate_hz: float, statuses: tuple[str, ...]
) -> list[float]:
    """Return how long after its end every final block first had one of the statuses, seconds."""
    first: dict[Any, float] = {}
    final = set()
    for at, change in changes:
        piece = change.piece
        key = (piece.of, piece.start, piece.end)
        if piece.kind == "block" and change.status in statuses:
            first.setdefault(key, at - piece.end / rate_hz)
        if piece.kind == "block" and piece.final:
            final.add(key)
    return [delay for key, delay in first.items() if key in final]


def describe_change(at: float, change: Change, rate_hz: float) -> str:
    """Return a change as a line: when, what happened to which piece, its label and uncertainty."""
    piece, before = change.piece, change.before
    name = f"{piece.kind} {piece.of}"
    was = ""
    if before is not None and before.label != piece.label:
        was = f", was {before.label}"
    return (
        f"{at:8.2f} s  {change.status:7}  {name:12} {piece.start / rate_hz:8.2f} to "
        f"{piece.end / rate_hz:8.2f} s  {piece.label} ({piece.uncertainty:.2f}){was}"
    )


def describe_forecast(forecast: BlockForecast, rate_hz: float) -> str:
    """Return what comes next as a line: what goes on, what follows, when and how probably."""
    when = ""
    if forecast.next_row is not None:
        when = f" at {forecast.next_row / rate_hz:.2f} s"
    return (
        f"{forecast.row / rate_hz:8.2f} s  next     block {forecast.of:6} {forecast.label} "
        f"({forecast.probability:.0%}) goes on, then {forecast.next_label} "
        f"({forecast.next_probability:.0%}){when}"
    )
