"""Datasets of simulated captures, by name (thesis table 3.1 and chapter 8)."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from besman.exceptions import ConfigError, nearest
from besman.synthetic import exoskeleton, gestures, reaching, two_arms
from besman.synthetic.ball_throw import draw_ball_style
from besman.synthetic.cameras import Room, to_unlabelled
from besman.synthetic.capture import Capture, write_capture
from besman.synthetic.person import Person, draw_person
from besman.synthetic.script import Temper, draw_temper
from besman.synthetic.stance import draw_stance, stream
from besman.synthetic.stick_throw import STICK, ThrowKind, simulate_throw_take
from besman.synthetic.take import Plan, Setting, Things, play_plan

Planner = Callable[[Person, Temper, Callable[[int], np.random.Generator], range], Plan]
Progress = Callable[[float], None]


@dataclass(frozen=True)
class SyntheticDataset:
    """One dataset.

    Attributes
    ----------
    classes : tuple of str
        Labels of its segments.
    repetitions : tuple of int
        How many of each person, in the thesis.
    per_take : int
        How many repetitions make one file.
    rate_hz : float
        Usual frames per second.
    kind : ThrowKind or None
        What is thrown.
    planners : tuple of (str, Planner)
        What is done in a take, with the word that the file's name ends in; several make as many
        takes.
    things : callable, optional
        Objects, see `besman.synthetic.take.Setting`.
    seen_by : str
        ``cameras``, ``suit`` or ``exoskeleton``.
    diversity : float
        How much people differ.
    """

    classes: tuple[str, ...]
    repetitions: tuple[int, ...]
    per_take: int
    rate_hz: float = 100.0
    kind: ThrowKind | None = None
    planners: tuple[tuple[str, Planner], ...] = ()
    things: Things | None = None
    seen_by: str = "cameras"
    diversity: float = 1.0


_SUFFIXES = {"cameras": ".tsv", "suit": ".mvnx", "exoskeleton": ".csv"}
_THROW_CLASSES = ("idle", "strike_out", "throw", "swing_out")
_STICK_COUNTS = (41, 62, 75, 78, 90, 105, 246)
_BALL = ThrowKind(draw_ball_style, marked=False, key=(zlib.crc32(b"ball_throw"),))

DATASETS = {
    "step": SyntheticDataset(
        reaching.STEP_CLASSES, (29, 29, 29, 28, 28, 28), 10, planners=(("", reaching.plan_step),)
    ),
    "lever": SyntheticDataset(
        reaching.LEVER_CLASSES, (32, 36), 8, planners=(("", reaching.plan_lever),)
    ),
    "pick_and_place": SyntheticDataset(
        reaching.PICK_AND_PLACE_CLASSES,
        (6, 6, 6),
        1,
        rate_hz=60.0,
        planners=(("", reaching.plan_pick_and_place),),
        things=reaching.handle_box,
    ),
    "ball_throw": SyntheticDataset(_THROW_CLASSES, (24,) * 10, 8, kind=_BALL),
    "stick_throw": SyntheticDataset(_THROW_CLASSES, _STICK_COUNTS, 8, kind=STICK),
    "stick_throw_unmarked": SyntheticDataset(
        _THROW_CLASSES, _STICK_COUNTS, 8, kind=replace(STICK, marked=False)
    ),
    "stick_throw_marked": SyntheticDataset(_THROW_CLASSES, (10, 11, 13), 13, kind=STICK),
    "gestures": SyntheticDataset(
        gestures.GESTURE_CLASSES,
        (10, 10, 11, 11, 11, 42),
        50,
        rate_hz=60.0,
        planners=tuple((g, gestures.gesture_planner(g)) for g in gestures.GESTURE_CLASSES),
        seen_by="suit",
        diversity=1.8,
    ),
    "object_rotation": SyntheticDataset(
        two_arms.OBJECT_ROTATION_ACTIONS,
        (10, 10, 13),
        5,
        planners=(("", two_arms.plan_object_rotation),),
        things=two_arms.hold_frame,
    ),
    "circle_drawing": SyntheticDataset(
        ("move_to_start", "circle_up", "circle_down", "move_to_rest"),
        (6,),
        6,
        planners=(("", exoskeleton.plan_circle_drawing),),
        seen_by="exoskeleton",
    ),
    "rotation": SyntheticDataset(
        ("turn_clockwise", "turn_counterclockwise"),
        (3,),
        6,
        planners=(("", exoskeleton.plan_rotation),),
        seen_by="exoskeleton",
    ),
}


def captures(
    name: str,
    n_subjects: int | None = None,
    n_repetitions: int | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    room: Room | None = None,
    progress: Progress | None = None,
) -> Iterator[Capture]:
    """Simulate a dataset, one take after the other.

    A person is the same whatever the number of people; a repetition is the same whatever the
    number of repetitions and the rate.

    Parameters
    ----------
    name : str
        One of `DATASETS`.
    n_subjects, n_repetitions : int, optional
        How many people, and how often each does what there is to do; as in the thesis by default.
    rate_hz : float, optional
        Frames per second, 60 to 500.
    seed : int
        Another seed, other people.
    room : Room, optional
        Cameras that lose markers and know no names; by default every marker is seen and named.
    progress : callable, optional
        Gets the share done.

    Yields
    ------
    Capture

    Raises
    ------
    ConfigError
        If there is no such dataset or a number is out of range.
    """
    dataset = _find(name)
    rate_hz = rate_hz if rate_hz is not None else dataset.rate_hz
    _check(name, dataset, n_subjects, n_repetitions, rate_hz, seed, room)
    n_subjects = len(dataset.repetitions) if n_subjects is None else n_subjects
    takes = [
        (subject, number, part, rows)
        for subject in range(n_subjects)
        for number, (part, rows) in enumerate(_takes(dataset, subject, n_repetitions))
    ]
    for done, (subject, number, part, rows) in enumerate(takes):
        several = sum(take[0] == subject for take in takes) > 1
        stem = f"subject{subject + 1}" + (f"_{part or f'run{number + 1}'}" if several else "")
        capture = _simulate(
            name, dataset, subject, part, rows, rate_hz, seed, stem + _SUFFIXES[dataset.seen_by]
        )
        if room is not None:
            key = (zlib.crc32(name.encode()), subject, number, 2)
            capture = to_unlabelled(capture, stream(seed, *key), room)
        yield capture
        if progress is not None:
            progress((done + 1) / len(takes))


def write_synthetic(
    dataset: str,
    out: Path,
    n_subjects: int | None = None,
    n_repetitions: int | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    room: Room | None = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Simulate a dataset and write it; the parameters are those of `captures`.

    Parameters
    ----------
    dataset : str
        One of `DATASETS`.
    out : Path
        Folder to write to; made if it is not there.
    n_subjects, n_repetitions, rate_hz, seed, room, progress
        See `captures`.

    Returns
    -------
    list of Path
        The recordings written; each has its truth beside it.

    Raises
    ------
    ConfigError
        If there is no such dataset or a number is out of range.
    RecordingError
        If a file is there already or cannot be written.
    """
    made = captures(dataset, n_subjects, n_repetitions, rate_hz, seed, room, progress)
    return [write_capture(capture, out) for capture in made]


def _find(name: str) -> SyntheticDataset:
    """Return a dataset by its name."""
    if name not in DATASETS:
        raise ConfigError(f"synth: no dataset {name!r}; {nearest(name, DATASETS)}")
    return DATASETS[name]


def _check(
    name: str,
    dataset: SyntheticDataset,
    n_subjects: int | None,
    n_repetitions: int | None,
    rate_hz: float,
    seed: int,
    room: Room | None,
) -> None:
    """Refuse numbers that are out of range."""
    for what, value, low, high in (
        ("subjects", n_subjects, 1, 1000),
        ("repetitions", n_repetitions, 1, 1000),
        ("rate_hz", rate_hz, 60, 500),
        ("seed", seed, 0, 2**63),
    ):
        if value is not None and not low <= value <= high:
            raise ConfigError(f"{name}: {what}: got {value}, expected {low} to {high}")
    if room is not None and dataset.seen_by != "cameras":
        raise ConfigError(f"{name}: seen by a {dataset.seen_by}, which leaves no marker unnamed")


def _takes(
    dataset: SyntheticDataset, subject: int, n_repetitions: int | None
) -> list[tuple[str, range]]:
    """Split what one person does into takes."""
    usual = dataset.repetitions[subject % len(dataset.repetitions)]
    count = usual if n_repetitions is None else n_repetitions
    rows = [
        range(start, min(start + dataset.per_take, count))
        for start in range(0, count, dataset.per_take)
    ]
    return [(part, row) for part, _ in dataset.planners or (("", None),) for row in rows]


def _simulate(
    name: str,
    dataset: SyntheticDataset,
    subject: int,
    part: str,
    rows: range,
    rate_hz: float,
    seed: int,
    source: str,
) -> Capture:
    """Simulate one take."""
    if dataset.kind is not None:
        return simulate_throw_take(dataset.kind, subject, rows, rate_hz, seed, source)
    key = (zlib.crc32(name.encode()), subject)
    rng = stream(seed, *key, 0)
    person, temper, stance = draw_person(rng), draw_temper(rng, dataset.diversity), draw_stance(rng)
    planner = dict(dataset.planners)[part]
    task = zlib.crc32(part.encode())
    noise = stream(seed, *key, task, rows.start, rows.stop)
    joint_noise = None
    if dataset.seen_by == "exoskeleton":
        person = exoskeleton.exoskeleton_person(person)
        joint_noise = exoskeleton.constrain_joints(noise)
    # The person's own choices have number 0, the repetitions follow.
    plan = planner(person, temper, lambda index: stream(seed, *key, task, index + 1), rows)
    setting = Setting(rate_hz, source, noise, things=dataset.things, joint_noise=joint_noise)
    capture = play_plan(person, stance, plan, setting)
    if dataset.seen_by == "suit":
        return gestures.see_segments(capture, noise)
    if dataset.seen_by == "exoskeleton":
        return exoskeleton.log_joints(capture, person)
    return capture
