"""The stage that selects demonstrations."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from besman.config.stage import Items, NotNegative, Positive, Stage, Truth, Work
from besman.exceptions import nearest
from besman.records import HandTrajectory, LabelledRecording, LabelledSegments, Landing
from besman.records.layers import Side
from besman.stages.select.body_points import GapLimits
from besman.stages.select.hand_trajectory import Palm, Selected, map_record, select_segments
from besman.stages.select.targets import Aim, TargetSource

_LONGEST_S = {"movement": 10.0, "blocks": 60.0}


class SelectConfig(Stage):
    """Take the segments of one class as demonstrations (record mapping).

    Attributes
    ----------
    label : str, optional
        The class of a building block, e.g. ``throw``.
    action : str or sequence of str, optional
        In place of `label`: an action that stage ``compose`` finds. Several ``as: blocks``, all of
        them in `actions`: one placement serves them all, and `besman plan` has the blocks of all.
    as : "movement" or "blocks"
        Of an action: the hand's way alone, or also the blocks that it is made of, and what objects
        do in them. Objects are those of the marker set.
    actions : mapping of str to sequence of str
        Actions and the blocks that they are made of, in their order, for those that neither
        ``compose`` knows nor segments on the layer ``actions`` name. Rests between them do not
        matter; a movement that was cut in two counts once.
    object : str, optional
        Marker of an object that is thrown; where it comes down becomes the target.
    target : "object", "landing", "flight" or "release", optional
        What tells the target of a throw: where the tracked object falls to the floor, by its free
        flight; a landing file; the object's first metres after the hand let go, of which a few
        frames are enough; or place and speed of the hand when it is fastest, from where what it
        throws flies on. Not given: the landing file where it names the throw, then, where an object
        is named, the landing that the recording's own file says, the object's fall, its first
        metres, and the release, the first that tells a place. With neither there is no target. The
        results say which it was for each throw.
    landing : str, optional
        A landing file: CSV with the columns ``recording``, ``x_m``, ``y_m`` (or ``x_ft`` ...), or
        YAML or JSON, see `besman.io.landings`.
    target_height_m : float
        Flight and release are followed down to this height, as of a hoop; the target is the floor
        below, metres.
    target_scale : float
        The target is brought nearer to the releasing hand by this factor, for an arm that throws
        less far than the person.
    arm : "right" or "left"
        The arm whose hand is followed.
    least_duration_s : float
        Shorter segments are left out, seconds.
    greatest_duration_s : float, optional
        Longer ones are left out; if not given 10 s, of actions ``as: blocks`` 60 s.
    merge : bool
        Join segments of the class that touch: a movement that was cut in two.
    cutoff_hz : float
        Of the low-pass filter over the markers.
    rate_hz : float
        Samples per second of the demonstrations.
    longest_gap_s : float
        Gaps of back and hand markers up to this length are filled by a spline, seconds.
    longest_rigid_gap_s : float
        Gaps up to this length are filled where the other two markers of the cluster are seen. A
        segment with a longer gap is no demonstration, and is listed with the reason.
    object_in_hand_m : three float, optional
        Where what is held sits in the hand, metres: the robot's tool centre point follows it, in
        place of the point that the robot's tool says (``hand_to_tcp_m``). The hand's frame has its
        origin in the centroid of the three hand markers, x towards the fingers (from the middle of
        ``hand_left`` and ``hand_right`` to ``hand_top``) and z out of the back of the hand, so that
        y points to the person's left while the palm is down and the fingers forward.
    object_in_hand_wxyz : four float, optional
        How it is turned in the hand's frame: the tool's axes follow its axes, in place of
        ``hand_to_tcp_wxyz``. The tool points along z.
    palm : "measured" or "push"
        How the hand is turned: as it was measured; or with its palm where the hand pushes, told by
        its acceleration and gravity. Keypoints tell the first badly, and fingers hold a ball where
        a scoop would drop it.
    """

    method: Literal["label"] = "label"
    label: str | None = None
    action: str | Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    as_: Literal["movement", "blocks"] = Field(default="movement", alias="as")
    actions: dict[str, Annotated[tuple[str, ...], Field(min_length=1)]] = Field(
        default_factory=dict
    )
    object: str | None = None
    target: TargetSource | None = None
    landing: str | None = None
    target_height_m: NotNegative = 0.0
    target_scale: Positive = 1.0
    arm: Side = "right"
    least_duration_s: NotNegative = 0.0
    greatest_duration_s: Positive | None = None
    merge: bool = False
    cutoff_hz: Positive = 10.0
    rate_hz: Positive = 100.0
    longest_gap_s: NotNegative = 0.25
    longest_rigid_gap_s: NotNegative = 1.0
    object_in_hand_m: tuple[float, float, float] | None = None
    object_in_hand_wxyz: tuple[float, float, float, float] | None = None
    palm: Palm = "measured"

    model_config = ConfigDict(serialize_by_alias=True)

    leaves_out: ClassVar[bool] = True

    @field_validator("object_in_hand_wxyz")
    @classmethod
    def _check_turn(cls, turn: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if turn is not None and not np.linalg.norm(turn) > 1e-6:
            raise ValueError("a quaternion of zero turns nothing; (1, 0, 0, 0) leaves it as it is")
        return turn

    @model_validator(mode="after")
    def _check_choice(self) -> SelectConfig:
        if (self.label is None) == (self.action is None):
            raise ValueError(
                "expected one of label and action, got "
                + ("none" if self.label is None else "both")
            )
        if self.action is None and (self.actions or self.as_ == "blocks"):
            raise ValueError(
                "as: blocks and actions are of an action; expected action: NAME in place of label"
            )
        if isinstance(self.action, tuple):
            for name in self.action:
                if name not in self.actions:
                    raise ValueError(
                        f"action: got {name!r}, one of several; {nearest(name, self.actions)} "
                        "(select.actions)"
                    )
            if self.as_ != "blocks":
                raise ValueError("action: several make no one movement; expected as: blocks")
        return self

    @model_validator(mode="after")
    def _check_target(self) -> SelectConfig:
        needed = {"object": "object", "flight": "object", "landing": "landing"}
        key = needed.get(self.target or "")
        if key is not None and getattr(self, key) is None:
            what = "the marker of what is thrown" if key == "object" else "a landing file"
            raise ValueError(
                f"target: {self.target} needs select.{key}, {what}; without one there is "
                "target: release"
            )
        return self

    @property
    def sources(self) -> tuple[TargetSource, ...]:
        """What is asked for the target, in this order."""
        if self.target is not None:
            return (self.target,)
        if self.object is not None:
            return ("landing", "object", "flight", "release")
        return () if self.landing is None else ("landing",)

    @property
    def wanted(self) -> tuple[str, ...]:
        """The classes that are taken, be they building blocks or actions: one, but of actions."""
        wanted = self.label or self.action or ()
        return (wanted,) if isinstance(wanted, str) else wanted

    @property
    def grasp(self) -> np.ndarray:
        """What the tool centre point is to follow, shape (7,); see `HandTrajectory`."""
        place = (np.nan,) * 3 if self.object_in_hand_m is None else self.object_in_hand_m
        turn = (np.nan,) * 4 if self.object_in_hand_wxyz is None else self.object_in_hand_wxyz
        return np.concatenate([place, np.array(turn) / np.linalg.norm(turn)])

    @property
    def other_arm(self) -> SelectConfig:
        """The same for the person's other hand; nothing is thrown with it."""
        return self.model_copy(
            update={
                "arm": "left" if self.arm == "right" else "right",
                "object": None,
                "target": None,
                "landing": None,
            }
        )

    def items(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[LabelledSegments, ...],
        landings: tuple[Landing, ...] = (),
    ) -> Items:
        """Count the segments of the class."""
        labels = [label for found in segments for label in found.labels]
        return Items(sum(label in self.wanted for label in labels), "segments")

    def figures(
        self, demonstrations: tuple[HandTrajectory, ...], truth: Truth, *records: Any
    ) -> dict[str, Any]:
        """Return how many demonstrations there are, and what told the target of each."""
        targets = {one.name: one.target_by for one in demonstrations if one.target_by}
        return {"n_demonstrations": len(demonstrations)} | ({"target": targets} if targets else {})

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[LabelledSegments, ...],
        landings: tuple[Landing, ...] = (),
        work: Work = Work(),
    ) -> tuple[HandTrajectory, ...]:
        """Return the demonstrations, hand poses in the person's back frame."""
        chosen = select_segments(
            segments,
            *self.wanted,
            merge=self.merge,
            least_duration_s=self.least_duration_s,
            greatest_duration_s=self.greatest_duration_s or _LONGEST_S[self.as_],
        )

        def take(one: Selected) -> HandTrajectory:
            recording = recordings[one.recording]
            throw = 1 + sum(
                other.recording == one.recording and other.start < one.start for other in chosen
            )
            return map_record(
                recording,
                (one.start, one.stop),
                segments[one.recording].labels[one.segment],
                name=f"{recording.source}:{one.segment}",
                cutoff_hz=self.cutoff_hz,
                rate_hz=self.rate_hz,
                aim=self._aim(landings, recording.source, throw),
                palm=self.palm,
                side=self.arm,
                gaps=GapLimits(self.longest_gap_s, self.longest_rigid_gap_s),
                grasp=self.grasp,
            )

        # Sending recordings would take longer than reading a movement out of them.
        here = replace(work, jobs=1, workers=None)
        return tuple(
            here.map(
                take, chosen, name=lambda one: f"{recordings[one.recording].source}:{one.segment}"
            )
        )

    def _aim(self, landings: tuple[Landing, ...], source: str, throw: int) -> Aim:
        """Return where the target of one throw comes from."""
        known = (one.place for one in landings if one.is_of(source, throw))
        return Aim(
            sources=self.sources,
            object=self.object,
            landing=next(known, np.full(3, np.nan)),
            height_m=self.target_height_m,
            scale=self.target_scale,
        )
