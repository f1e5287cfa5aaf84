"""Everything that can be known about a pipeline before it runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from besman.config.resources import find_resource
from besman.exceptions import ConfigError, RecognitionError, RefinementError, nearest
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import PipelineConfig, learn_from, load_pipeline, needs_no_examples
from besman.records.layers import complete_truth, side_of
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task
from besman.stages.compose.stage import leave_out_actions
from besman.stages.label.stage import LabelTrajectoriesConfig
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.model_files import load_model


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
        For the first thing that would stop a run.
    """
    path = find_resource("pipelines", name)
    config = load_pipeline(path, settings)
    lines = [f"config: {path} is complete"]
    lines += _check_recordings(config)
    robot = load_robot(config.robot, config.tool)
    task = load_task(config.task)
    if task.tool != robot.tool.name:
        raise RefinementError(
            f"task {config.task}: needs tool {task.tool!r}, got tool: {robot.tool.name!r}"
        )
    lines.append(f"robot: {robot.name} with {robot.tool.name}, {robot.n} joints")
    method, usual = config.imitate.method, task.motion_plan
    other = "" if method == usual else f"; made for {usual}, imitated by {method}"
    lines.append(f"task: {config.task}, success within {100 * task.success_radius_m:g} cm{other}")
    return lines


def _check_recordings(config: PipelineConfig) -> list[str]:
    """Read the recordings, match their markers and look for examples of the class selected."""
    inputs = read_inputs(config.recordings, learn_from(config))
    markers = load_marker_set(config.label.markers)
    state = f"all markers of {markers.name} there"
    if isinstance(config.label, LabelTrajectoriesConfig):
        model = config.label.learn(markers, inputs.teacher)
        state = f"to be named as {model.n_markers} markers of {markers.name}"
    else:
        for recording in inputs.recordings:
            markers.match(recording.names, recording.source)
    seconds = sum(len(recording.time) / recording.rate_hz for recording in inputs.recordings)
    n = len(inputs.recordings)
    lines = [f"recordings: {n}, {seconds:.0f} s, {state}"]
    if needs_no_examples(config):
        lines.append(_check_model(config))
    else:
        examples = read_inputs(config.training) if config.training else inputs
        lines.append(_check_examples(config, examples))
    return lines


def _check_model(config: PipelineConfig) -> str:
    """Load a trained model, and look for the class selected."""
    model = str(config.recognize.model)
    counts = Counter(load_model(Path(model)).labels)
    _check_wanted(config, counts, f"is no class of {model}")
    return f"model: {model}, trained with {list_counts(counts)}"


def _check_examples(config: PipelineConfig, inputs: Inputs) -> str:
    """Count the labelled examples."""
    counts: dict[str, int] = {}
    truth = inputs.truth
    if config.select.label is not None:
        truth = leave_out_actions(truth, config.compose, side_of(config.segment.markers))
    for recording, manual in zip(inputs.recordings, truth, strict=True):
        if manual is None:
            continue
        for label in complete_truth(manual, len(recording.time), config.recognize.idle_s).labels:
            counts[label] = counts.get(label, 0) + 1
    if not counts:
        raise RecognitionError(
            "recognize: no labelled examples: no recording has a segments file beside it "
            "(STEM_manually_segmented.json); name recordings that have with training:"
        )
    _check_wanted(config, counts, "has no labelled example")
    return f"labelled examples: {list_counts(counts)}"


def _check_wanted(config: PipelineConfig, counts: Mapping[str, int], problem: str) -> None:
    """Refuse a class to select of which nothing is known."""
    wanted = config.select.wanted
    if wanted not in counts:
        key = "label" if config.select.label else "action"
        raise ConfigError(
            f"select.{key}: got {wanted!r}, which {problem}; {nearest(wanted, counts)}"
        )


def list_counts(counts: Mapping[str, int]) -> str:
    """Return classes with how many there are of each, in the order of their names."""
    return ", ".join(f"{label} {count}" for label, count in sorted(counts.items()))
