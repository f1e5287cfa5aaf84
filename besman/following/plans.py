"""What is followed: the trained models of a run, or of files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from besman.classifiers.novelty import UNKNOWN
from besman.exceptions import ConfigError, RunError
from besman.following.arms import FollowedArm, OnlineSegmentation
from besman.following.follower import Follower
from besman.following.foresight import Foresight
from besman.following.stream_names import LearnNames
from besman.geometry.row_blocks import by_rows
from besman.person.body import find_body
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.person.mirror import MIRROR, MIRROR_TURN, mirror_name
from besman.pipeline.config import learn_from
from besman.pipeline.finished_run import read_recipe, trained_model
from besman.pipeline.stored_run import open_run
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.records.frozen import hand_over
from besman.records.layers import IDLE, side_of
from besman.stages.compose.actions import LevelModel
from besman.stages.compose.borders import measure_brisk
from besman.stages.label.derive_markers import derive_markers
from besman.stages.label.methods import DefaultLabelConfig, LabelMethod
from besman.stages.label.model import MarkerModel
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.label.stage import LabelConfig, NamingBase
from besman.stages.label.trajectories import learn_from_recording
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.model_files import load_model
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.segment.sampling import sample_paths
from besman.stages.segment.signals import Scaling, measure_scaling, pool_scalings
from besman.stages.segment.stage import (
    SegmentConfig,
    ValleyOnlineConfig,
    ValleyVmciConfig,
    VmciOnlineConfig,
)
from besman.stages.segment.valley_online import Pace, pool_paces


@dataclass(frozen=True)
class FollowPlan:
    """What is known before a stream begins.

    Attributes
    ----------
    models : tuple of (RecognitionModel, tuple of str)
        Models that name blocks, each with the hands whose movement is segmented for it; no hands:
        those of the arms that the model looks at.
    label : label stage
        How trajectories become markers.
    teacher : str, optional
        Recording that the label stage learns from.
    segment : VmciOnlineConfig or ValleyOnlineConfig
        How to segment.
    levels : tuple of LevelModel
        Actions, the lowest level first.
    longest_blocks : int, optional
        See `Follower`.
    slow_hands : tuple of str
        Hands where actions may begin and end when they are slow.
    earlier : tuple of LabelledRecording
        Earlier movements, to measure scalings and brisk speeds on.
    blocks : tuple of LabelledSegments
        Blocks of some of them as the first model named them; what comes next is learnt from them.
    """

    models: tuple[tuple[RecognitionModel, tuple[str, ...]], ...]
    label: LabelMethod = field(default_factory=DefaultLabelConfig)
    teacher: str | None = None
    segment: OnlineSegmentation = field(default_factory=VmciOnlineConfig)
    levels: tuple[LevelModel, ...] = ()
    longest_blocks: int | None = None
    slow_hands: tuple[str, ...] = ()
    earlier: tuple[LabelledRecording, ...] = ()
    blocks: tuple[LabelledSegments, ...] = ()


def make_plan(
    run: Path | None,
    models: Sequence[Path],
    markers: str | None = None,
    calibration_s: float | None = None,
) -> FollowPlan:
    """Load what is followed.

    Parameters
    ----------
    run : Path, optional
        A finished run: its model names what its hands do, and its actions are followed.
    models : sequence of Path
        Model files of ``besman train``: each names what the arms it looks at do.
    markers : str, optional
        Marker set; the run's if not given, or ``right_arm``.
    calibration_s : float, optional
        Measure the scaling on so many seconds from the start of the stream, not on the run's
        recordings.

    Raises
    ------
    BesmanError
        If there is neither, a folder is not a run, or a file cannot be read.
    """
    if run is None and not models:
        raise ConfigError(
            "besman follow: got neither --run nor --model; expected a run folder, a model of "
            "besman train, or both"
        )
    if calibration_s is not None and not calibration_s > 0:
        raise ConfigError(f"--calibration: got {calibration_s:g} s; expected a positive time")
    plan = FollowPlan(()) if run is None else _plan_of_run(run)
    changes: dict[str, Any] = {
        "models": (*plan.models, *((load_model(path), ()) for path in models))
    }
    if markers is not None:
        changes["label"] = plan.label.model_copy(update={"markers": markers})
    if calibration_s is not None:
        changes["segment"] = plan.segment.model_copy(update={"calibration_s": calibration_s})
    return FollowPlan(**{**vars(plan), **changes})


def _plan_of_run(run: Path) -> FollowPlan:
    """Load a run's models and recordings."""
    config, stored = read_recipe(run), open_run(run, needs_state=False)
    if isinstance(config.recognize, OneThrowConfig):
        raise RunError(
            f"{run}: recognize.method one_throw looks at whole recordings and learns nothing to "
            "follow by; expected a run with a trained model"
        )
    given = config.recognize.model
    model = trained_model(run) if given is None else load_model(Path(given))
    segment: OnlineSegmentation = VmciOnlineConfig()
    if isinstance(config.segment, ValleyVmciConfig | ValleyOnlineConfig):
        segment = ValleyOnlineConfig(longest_s=config.segment.longest_s)
    if isinstance(config.segment, SegmentConfig | VmciOnlineConfig):
        values = config.segment.model_dump(exclude={"method"}, exclude_none=True)
        segment = VmciOnlineConfig(**values)
    stages = [name for name in ("label", "label_training") if name in stored.stages]
    compose = config.compose
    return FollowPlan(
        ((model, config.segment.markers),),
        config.label,
        learn_from(config),
        segment,
        () if compose is None else trained_model(run, "train_actions"),
        None if compose is None else compose.longest_blocks,
        () if compose is None else compose.hands,
        tuple(recording for name in stages for recording in stored.record(name)),
        tuple(stored.record("recognize")) if "recognize" in stored.stages else (),
    )


def label_stream(plan: FollowPlan, recording: Recording) -> LabelledRecording:
    """Give the trajectories of a recording their names, and leave its gaps to the follower.

    Trajectories without names are named over the whole recording, with the gaps filled: their
    names are not known sample by sample.

    Raises
    ------
    BesmanError
        If the marker set does not fit the recording.
    """
    marker_set = load_marker_set(plan.label.markers)
    if _finds_names(plan.label, recording, marker_set):
        from besman.io.recordings.formats import read_recording

        teachers = () if plan.teacher is None else (read_recording(Path(plan.teacher)),)
        labelled: LabelledRecording = plan.label.run((recording,), marker_set, *teachers)[0]
        return labelled
    return label_by_names(recording, marker_set)


def learn_names_of(plan: FollowPlan) -> LearnNames:
    """Return how points without a name are named: as in the first of the earlier movements.

    Where there are none, as in the recording that the label stage learns from; where it names none,
    as in the marker set's own pose.
    """

    def learn(marker_set: MarkerSet) -> MarkerModel:
        for one in plan.earlier:
            if set(marker_set.required) <= set(one.markers):
                # They were turned round if the person is left-handed, and their names with them.
                is_left = marker_set.side == "left"
                names = tuple(map(mirror_name, one.markers)) if is_left else one.markers
                named = Recording(one.time, one.positions, names, one.rate_hz, one.source)
                return learn_from_recording(named, marker_set)
        if plan.teacher is not None and isinstance(plan.label, NamingBase):
            from besman.io.recordings.formats import read_recording

            return plan.label.learn(marker_set, read_recording(Path(plan.teacher)))
        return model_from_pose(marker_set)

    return learn


def label_by_names(recording: Recording, marker_set: MarkerSet) -> LabelledRecording:
    """Give the trajectories of a recording the names that the marker set has for theirs.

    Raises
    ------
    BesmanError
        If a required marker is not among the names.
    """
    columns = marker_set.match(recording.names, recording.source)
    chosen = list(columns.values())
    # Of an hour each copy has hundreds of megabytes: one is made.
    positions = recording.gather(chosen)
    turned = None if recording.orientations is None else recording.orientations[:, chosen]
    if marker_set.side == "left":
        positions *= MIRROR
        turned = None if turned is None else turned * MIRROR_TURN
    labelled = LabelledRecording(
        recording.time,
        hand_over(positions),
        tuple(columns),
        by_rows(lambda some: ~np.isfinite(some[:, :, 0]), positions),
        recording.rate_hz,
        recording.source,
        recording.first_frame,
        turned,
    )
    # A stream does not know what comes later.
    return derive_markers(labelled, marker_set, hold=False)


def _finds_names(label: LabelMethod, recording: Recording, marker_set: MarkerSet) -> bool:
    """Tell whether trajectories have to be named: required markers lack a name."""
    if not label.looks_at_names:
        return True
    own = marker_set.find(recording.names, recording.source)
    return not isinstance(label, LabelConfig) and not own.keys() >= set(marker_set.required)


def make_follower(
    plan: FollowPlan, recording: LabelledRecording, horizon_blocks: int | None, steady_s: float
) -> Follower:
    """Make a follower for a stream that is like a recording: its markers and rate.

    Parameters
    ----------
    plan : FollowPlan
    recording : LabelledRecording
        Its positions are not looked at.
    horizon_blocks, steady_s
        See `Follower`.

    Raises
    ------
    BesmanError
        As `Follower`.
    """
    arms = []
    for index, (model, hands) in enumerate(plan.models):
        if not hands:
            body = find_body(recording.markers, recording.source)
            hands = tuple(arm.hand for arm in body.arms_of(model.recipe.markers))
        scaling = _measure_scaling(plan, hands, recording.rate_hz)
        foresight = _learn_foresight(plan, model) if index == 0 else None
        arms.append(FollowedArm(_name(hands), hands, model, scaling, foresight))
    brisk: Mapping[str, float] = {
        hand: measure_brisk(plan.earlier, hand) for hand in plan.slow_hands if plan.levels
    }
    return Follower(
        recording.markers,
        recording.rate_hz,
        arms,
        plan.levels,
        plan.segment,
        brisk_m_s=brisk,
        longest_blocks=plan.longest_blocks,
        horizon_blocks=horizon_blocks,
        steady_s=steady_s,
        source=recording.source,
        first_frame=recording.first_frame,
        oriented=recording.orientations is not None,
    )


def _name(hands: tuple[str, ...]) -> str:
    """Name the arm, or the arms, that hands are of."""
    return "+".join(dict.fromkeys(side_of((hand,)) for hand in hands))


def _learn_foresight(plan: FollowPlan, model: RecognitionModel) -> Foresight | None:
    """Learn what comes next from named blocks; None if there are none that move."""
    movements = {label for found in plan.blocks for label in found.labels} - {IDLE, UNKNOWN}
    if not movements:
        return None
    return Foresight(plan.earlier, plan.blocks, model.recipe)


def _measure_scaling(
    plan: FollowPlan, hands: tuple[str, ...], sample_rate_hz: float
) -> Scaling | Pace | None:
    """Measure the scaling on earlier movements, where these hands were recorded."""
    segment = plan.segment
    if segment.calibration_s is not None:
        return None
    known = [one for one in plan.earlier if set(hands) <= set(one.markers)]
    if not known:
        return None
    if isinstance(segment, ValleyOnlineConfig):
        return pool_paces([segment.measure(one, hands) for one in known])
    rate_hz = min(segment.rate_hz, sample_rate_hz)
    return pool_scalings([measure_scaling(sample_paths(one, hands, rate_hz)[0]) for one in known])
