"""A robot's twin that moves while a person does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import ConfigError, RecordingError
from besman.following.frame_stream import FrameStream, MakeCapture, NamedFrame, Told
from besman.following.hand_placement import HandPlacement, MirrorPlan, learn_placement
from besman.following.hand_stream import HandStream
from besman.following.twin import Twin
from besman.live.stream import Source, StreamFormat
from besman.motion.safe_setpoints import SetPoints
from besman.records import FloatArray
from besman.robot.inverse_kinematics import IkWeights
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import RATE_HZ
from besman.robot.model import Robot
from besman.simulation.arm_in_mujoco import ArmInMujoco

_IDLE_S = 0.01
# What moved less than this in the first seconds says little of where it will move.
_LITTLE_M = 0.15

Take = Callable[[SetPoints], None]


class Moment(NamedTuple):
    """What is shown of the present.

    Attributes
    ----------
    time_s : float
        Of the stream.
    state : str
        Of the arm; "" until it begins.
    markers : array, shape (M, 3)
        Metres, NaN where not seen: in the arm's world, or in the laboratory until the arm begins.
    joints : array, shape (n,), optional
        Of the simulated arm, rad.
    asked : array, shape (3,), optional
        Where the hand wants the tool centre point, metres.
    away_m, delay_ms : float, optional
        How far that is, and how long the last packet took to become set-points.
    """

    time_s: float
    state: str
    markers: FloatArray
    joints: FloatArray | None = None
    asked: FloatArray | None = None
    away_m: float | None = None
    delay_ms: float | None = None


class Mirror:
    """Reads a source; an arm follows the hand in it, and a simulated one follows the set-points.

    Set-points are given for every millisecond of this machine's clock: a packet changes those to
    come. A hand that is hidden or jumps, and a source that says nothing, bring the arm to rest.

    Parameters
    ----------
    source : Source
    plan : MirrorPlan
    learn_s : float
        Without a placement it is learnt from so many seconds in which the hand is seen.
    by_frames : bool
        Time is what the frames say, not this machine's clock: of a file that is read as fast as
        can be.
    take : callable, optional
        Is given all set-points, in their order.
    """

    def __init__(
        self,
        source: Source,
        plan: MirrorPlan,
        learn_s: float = 10.0,
        by_frames: bool = False,
        take: Take = lambda points: None,
    ) -> None:
        if not 1.0 <= learn_s <= 600.0:
            raise ConfigError(f"--learn: got {learn_s:g} s; expected 1 to 600")
        self._stream = FrameStream(
            source, plan.markers, idle_s=_IDLE_S, learn_names=plan.learn_names
        )
        self._stream.is_timed = False
        self._plan, self._learn_s, self._by_frames, self._give = plan, learn_s, by_frames, take
        self._placement = plan.placement
        self._learning: Future[HandPlacement] | None = None
        self._threads = ThreadPoolExecutor(1)
        self._poses: list[tuple[int, FloatArray]] = []
        self._twin: Twin | None = None
        self._last_row = self._n_given = self._n_hidden = self._n_refused = 0
        self._begun_s = 0.0
        self._was = ""
        self._moment: Moment | None = None
        self._names: tuple[str, ...] = ()

    def open(self, make_capture: MakeCapture | None = None) -> StreamFormat:
        """Connect to the source; see `besman.following.frame_stream.FrameStream.open`."""
        self._warm_up()
        found = self._stream.open(make_capture)
        self._hand = HandStream(self._stream.blank, self._plan.side)
        self._names = self._stream.blank.markers
        self._stream.begin_recording()
        return found

    def run(self) -> Iterator[dict[str, Any]]:
        """Mirror until the source ends; yield what the arm does.

        Raises
        ------
        BesmanError
            If the stream cannot be read any more or be recorded, or the arm cannot begin.
        """
        try:
            yield from self._stream.run(self._take, self._go_on, self._finish)
        finally:
            self._threads.shutdown(wait=False, cancel_futures=True)
        yield from self._tell_end()

    def end_now(self) -> Iterator[dict[str, Any]]:
        """Bring the arm to rest, and make the recording whole.

        Raises
        ------
        BesmanError
            As `run`.
        """
        yield from self._stream.end(self._take, self._finish)
        yield from self._tell_end()

    @property
    def times(self) -> FloatArray:
        """How long the last frames took; see `besman.following.frame_stream.FrameStream.times`.

        From when the arm has begun.
        """
        return self._stream.times

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self._plan.robot

    @property
    def markers(self) -> tuple[str, ...]:
        """Names of the markers that are looked at; none before `open`."""
        return self._names

    def look(self) -> Moment:
        """Return the present, from any thread."""
        nothing = np.full((len(self.markers), 3), np.nan)
        return self._moment or Moment(0.0, "", nothing)

    def _describe(self, frame: NamedFrame) -> Moment:
        at_s = self._stream.n_frames / self._stream.format.rate_hz
        if self._twin is None or self._placement is None:
            return Moment(at_s, "", frame.markers)
        world = self._placement.place_points(self._hand.in_back(frame.markers))
        joints = self._reached if self._n_given else self._twin.positions
        delay_ms = 1e3 * self._stream.last_delay_s if self._stream.is_timed else None
        asked = self._twin.target[:3, 3]
        return Moment(at_s, self._was, world, joints, asked, self._twin.away_m, delay_ms)

    def summary(self) -> dict[str, Any]:
        """Return what became of packets and set-points, and how long each frame took."""
        counts = {
            "hidden": self._n_hidden,
            "withheld": self._n_refused,
            "set_points": self._n_given,
        }
        return self._stream.summary() | counts

    def _tell_end(self) -> Iterator[dict[str, Any]]:
        yield {"kind": "end", **self.summary()}
        self._stream.raise_failure()

    def _finish(self) -> Told:
        """Bring the arm to rest."""
        if self._twin is None:
            raise RecordingError(
                f"{self._stream.format.source}: ended before the arm could begin: "
                + self._what_lacks()
            )
        while not self._twin.rests:
            self._pass_on(1)
        return []

    @property
    def _rests(self) -> bool:
        return self._twin is not None and self._twin.rests

    def _go_on(self) -> Told:
        """Give the set-points of the time that has passed."""
        n = self._advance()
        changes = self._tell_change("rests" if self._rests else self._was)
        if self._moment is not None and (n or (changes and self._n_given)):
            # The arm moves on where no frame comes.
            self._moment = self._moment._replace(state=self._was, joints=self._reached)
        return changes

    def _take(self, frame: NamedFrame) -> Told:
        """Take one frame, and let it be seen; return what is to be told."""
        told = self._move(frame)
        self._moment = self._describe(frame)
        return told

    def _move(self, frame: NamedFrame) -> Told:
        pose = self._hand.take(frame.markers)
        if self._twin is None:
            return [] if pose is None else self._prepare(pose)
        row, self._stream.is_timed = self._stream.n_frames, True
        self._advance()
        follows = False
        if pose is not None:
            step_s = (row - self._last_row) / self._stream.format.rate_hz
            follows, self._last_row = self._twin.follow(pose, step_s), row
            self._n_refused += not follows
        self._n_hidden += pose is None
        state = "follows" if follows else "hidden" if pose is None else "withheld"
        if not follows and self._was == "rests":
            state = "rests"
        return [*self._tell_change(state), self._tell_joints()]

    def _prepare(self, pose: FloatArray) -> list[dict[str, Any]]:
        """Begin, once it is known where the hand goes; until then keep its poses."""
        row = self._stream.n_frames
        if self._placement is None and self._learning is None:
            self._poses.append((row, pose))
            if len(self._poses) < self._learn_s * self._stream.format.rate_hz:
                return []
            rows, poses = zip(*self._poses, strict=True)
            seconds = np.array(rows) / self._stream.format.rate_hz
            self._learning = self._threads.submit(
                learn_placement, self._plan.robot, seconds, np.array(poses)
            )
            self._poses = []
            return self._tell_learning(np.array(poses)[:, :3, 3])
        if self._learning is not None:
            # A file that is read as fast as can be has no time of its own to pass.
            if not (self._by_frames or self._learning.done()):
                return []
            self._placement, self._learning = self._learning.result(), None
        assert self._placement is not None
        self._twin = Twin(self._plan.robot, self._placement, pose)
        self._simulated = ArmInMujoco(self._plan.robot, self._twin.positions)
        self._last_row, self._first_row = row, row
        self._begun_s = time.perf_counter()
        return [self._tell_begin(), self._tell_joints()]

    def _advance(self) -> int:
        """Give the set-points up to the present; return how many."""
        if self._twin is None:
            return 0
        if self._by_frames:
            passed_s = (self._stream.n_frames - self._first_row) / self._stream.format.rate_hz
        else:
            passed_s = time.perf_counter() - self._begun_s
        n = int(passed_s * RATE_HZ + 1e-6) - self._n_given
        if n > 0:
            self._pass_on(n)
        return max(n, 0)

    def _pass_on(self, n: int) -> None:
        assert self._twin is not None
        points = self._twin.advance(n)
        self._n_given += n
        self._give(points)
        self._reached = self._simulated.follow(*points)[-1]

    def _tell_learning(self, places: FloatArray) -> list[dict[str, Any]]:
        extent = float(np.linalg.norm(np.ptp(places, axis=0)))
        little = ""
        if extent < _LITTLE_M:
            little = f"; it moved by {extent:.2f} m only, which tells little of where it will move"
        text = f"the hand was seen for {self._learn_s:g} s: the arm's place is looked for{little}"
        return [{"kind": "notice", "text": text}]

    def _tell_begin(self) -> dict[str, Any]:
        assert self._placement is not None
        return {
            "kind": "begin",
            "time_s": self._stream.n_frames / self._stream.format.rate_hz,
            "robot": self._plan.robot.name,
            "tool": self._plan.robot.tool.name,
            "joints": list(self._plan.robot.joint_names),
            "back2world": self._placement.back2world.tolist(),
            "shift_m": self._placement.shift.tolist(),
            "scale": self._placement.scale,
        }

    def _tell_joints(self) -> dict[str, Any]:
        """Return the set-point of the moment, and how far the arm is from what was asked."""
        assert self._twin is not None
        simulated = self._reached if self._n_given else self._twin.positions
        return {
            "kind": "joints",
            "time_s": self._stream.n_frames / self._stream.format.rate_hz,
            "positions_rad": np.round(self._twin.positions, 6).tolist(),
            "simulated_rad": np.round(simulated, 6).tolist(),
            "away_m": round(self._twin.away_m, 4),
        }

    def _tell_change(self, state: str) -> Told:
        """Say once that the arm follows, comes to rest, and why, or rests."""
        if state == self._was:
            return []
        self._was = state
        at_s = self._stream.n_frames / self._stream.format.rate_hz
        return [{"kind": "arm", "time_s": at_s, "state": state}]

    def _what_lacks(self) -> str:
        if not self._hand.knows_back:
            return "back and hand were not seen together for half a second"
        if self._learning is not None:
            return "its place was still looked for"
        seen = len(self._poses) / self._stream.format.rate_hz
        return f"the hand was seen for {seen:.1f} s; expected {self._learn_s:g} (--learn)"

    def _warm_up(self) -> None:
        """Have kernels, libraries and the model loaded before the first packet."""
        robot = self._plan.robot
        start = robot.home[None]
        still = HandPlacement(np.eye(3), np.zeros(3), 1.0, np.eye(4), start, IkWeights(), False)
        pose = forward_kinematics(robot.chain, robot.home[None])[0]
        twin = Twin(robot, still, pose)
        twin.follow(pose, 0.01)
        ArmInMujoco(robot, robot.home).follow(*twin.advance(2))
