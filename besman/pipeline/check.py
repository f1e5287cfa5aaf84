"""Everything that can be known about a pipeline before it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from besman.config.resources import find_resource
from besman.exceptions import ConfigError, nearest
from besman.person.body import find_body
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.pipeline.config import (
    PipelineConfig,
    check_whole_task,
    learn_from,
    load_pipeline,
    needs_no_examples,
)
from besman.pipeline.known_classes import count_examples, count_model, list_counts
from besman.pipeline.usable_inputs import keep_usable
from besman.records import MotionPlan
from besman.robot.model import Robot, load_robot
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import is_whole_task, load_task
from besman.stages.label.methods import LabelMethod
from besman.stages.label.stage import NamingBase
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.refine.begin_plan import place_plan
from besman.stages.refine.stage import check_tool
from besman.stages.select.flight import check_thrown


def check_pipeline(name: str, settings: tuple[str, ...] = ()) -> list[str]:
    """Check a pipeline's config, recordings, markers, labelled examples, robot and task.

    Parameters
    ----------
    name : str
        A YAML file, or the name of a pipeline.
    settings : tuple of str
        ``KEY=VALUE``, as of ``besman run --set``.

    Returns
    -------
    list of str
        One line for each thing that was found good.

    Raises
    ------
    BesmanError
        For the first thing that would stop a run, in the words of the run.
    """
    path = find_resource("pipelines", name)
    config = load_pipeline(path, settings)
    lines = [f"config: {path} is complete"]
    lines += _check_recordings(config)
    robot = load_robot(config.robot, config.tool)
    if is_whole_task(config.task):
        whole = check_whole_task(config).success
        return [
            *lines,
            f"robot: {robot.name} with {robot.tool.name}, {robot.n} joints",
            f"task: {config.task}, success within {100 * whole.success_radius_m:g} cm and "
            f"{whole.success_angle_deg:g} degrees",
        ]
    task = load_task(config.task)
    _check_task(robot, task, thrown=bool(config.select.sources))
    lines.append(f"robot: {robot.name} with {robot.tool.name}, {robot.n} joints")
    if config.second_arm is not None:
        second = load_robot(config.second_arm.robot, config.second_arm.tool)
        _check_task(second, task, thrown=bool(config.select.other_arm.sources))
        lines.append(f"second arm: {second.name} with {second.tool.name}, {second.n} joints")
    method, usual = config.imitate.method, task.motion_plan
    other = "" if method == usual else f"; made for {usual}, imitated by {method}"
    lines.append(f"task: {config.task}, success within {100 * task.success_radius_m:g} cm{other}")
    return lines


def _check_recordings(config: PipelineConfig) -> list[str]:
    """Read the recordings, match their markers and look for examples of the class selected."""
    select = config.select
    inputs = read_inputs(config.recordings, learn_from(config), config.read, select.landing)
    markers = load_marker_set(config.label.markers)
    inputs, left_out = keep_usable(config.label, inputs, markers)
    state, expected = _check_markers(config.label, inputs, markers)
    for source, names in expected.items():
        find_body((*names, *markers.derived), source)
    seconds = sum(len(recording.time) / recording.rate_hz for recording in inputs.recordings)
    n = len(inputs.recordings)
    lines = [f"recordings: {n}, {seconds:.0f} s, {state}"]
    if left_out:
        lines.append(f"left out, as they cannot be used: {', '.join(left_out)}")
    if select.object is not None:
        lines += _check_object(select.object, expected)
    lines += _check_target(config, inputs)
    if isinstance(config.recognize, OneThrowConfig):
        label = config.recognize.label
        return [*lines, f"recognition: one {label} in each recording"]
    if needs_no_examples(config):
        counts = list_counts(count_model(config))
        return [*lines, f"model: {config.recognize.model}, trained with {counts}"]
    examples = inputs
    if config.training:
        examples = read_inputs(config.training, learn_from(config), config.read)
        state, _ = _check_markers(config.label, examples, markers)
        lines.append(f"training: {len(examples.recordings)} recordings, {state}")
    return [*lines, f"labelled examples: {list_counts(count_examples(config, examples))}"]


def _check_markers(
    label: LabelMethod, inputs: Inputs, markers: MarkerSet
) -> tuple[str, dict[str, tuple[str, ...]]]:
    """Label what has names; say what has, and which markers each recording may turn out to have."""
    expected = {}
    unnamed = []
    for recording in inputs.recordings:
        taken = label.take_given(recording, markers, inputs.teacher)
        if taken is None:
            unnamed.append(recording)
        else:
            expected[recording.source] = taken.markers
    if not unnamed:
        return f"all markers of {markers.name} there", expected
    assert isinstance(label, NamingBase)
    model = label.learn(markers, inputs.teacher)
    for recording in unnamed:
        own = markers.find(recording.names, recording.source) if label.looks_at_names else ()
        expected[recording.source] = tuple(dict.fromkeys((*own, *model.markers)))
    some = f"{len(unnamed)} of them " if expected.keys() - {one.source for one in unnamed} else ""
    return f"{some}to be named as {model.n_markers} markers of {markers.name}", expected


def _check_object(thrown: str, expected: Mapping[str, Sequence[str]]) -> list[str]:
    """Refuse recordings of which none has the thrown object's marker; list those without."""
    without = [source for source, markers in expected.items() if thrown not in markers]
    if len(without) == len(expected):
        check_thrown(thrown, expected[without[0]], without[0])
    return [f"without marker {thrown} of a thrown object: {', '.join(without)}"] if without else []


def _check_target(config: PipelineConfig, inputs: Inputs) -> list[str]:
    """Say what tells the targets; refuse a landing file that knows no recording."""
    select = config.select
    told = select.sources
    if not inputs.landings:
        told = tuple(source for source in told if source != "landing")
    if not told:
        return []
    lines = [f"target: by {', else '.join(told)}"]
    if not inputs.landings:
        return lines
    sources = [recording.source for recording in inputs.recordings]
    without = [
        source
        for source in sources
        if not any(one.is_of(source, one.throw) for one in inputs.landings)
    ]
    if len(without) == len(sources):
        raise ConfigError(
            f"select.landing: {select.landing} has a landing for none of the recordings; "
            f"{nearest(sources[0], [one.recording for one in inputs.landings])}"
        )
    if without:
        lines.append(f"without a landing: {', '.join(without)}")
    return lines


def _check_task(robot: Robot, task: Task, thrown: bool) -> None:
    """Refuse a tool that is not the task's, and a task that needs what no motion will have."""
    check_tool(robot, task)
    n = robot.n
    poses = np.zeros((2, 7))
    poses[:, 3], poses[1, 0] = 1.0, 0.02
    # As a demonstration gives it; of a thrown object the touchdown is known too.
    plan = MotionPlan(
        weights=np.zeros((n, 1)),
        start=robot.home,
        goal=robot.home,
        duration=1.0,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=poses[1],
        target=np.full(3, 0.0 if thrown else np.nan),
        name="every motion",
        label="",
        start_pose=poses[0],
    )
    place_plan(plan, robot, task)
