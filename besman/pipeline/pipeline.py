"""The way of the data: every stage once, top to bottom."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from besman.config.stage import Items, Truth
from besman.exceptions import FileError, RunError, nearest
from besman.person.marker_set import load_marker_set
from besman.pipeline.clock import Clock
from besman.pipeline.config import (
    PipelineConfig,
    check_whole_task,
    learn_from,
    needs_no_examples,
    pipeline_yaml,
)
from besman.pipeline.finished_run import trained_model
from besman.pipeline.known_classes import count_examples, count_model
from besman.pipeline.preload import PRELOAD
from besman.pipeline.run_folder import Run
from besman.pipeline.usable_inputs import keep_usable
from besman.records import JointTrajectory, LabelledRecording, LabelledSegments, TaskPlan
from besman.records.layers import actions_of, side_of
from besman.robot.model import Robot, find_tool, load_robot
from besman.simulation.tasks.kinds import is_whole_task, load_task, load_whole_task
from besman.stages.compose.actions import LevelModel
from besman.stages.compose.stage import leave_out_actions, pick_level
from besman.stages.export.task_exports import write_task_exports
from besman.stages.imitate.task_plans import ImitateTasks
from besman.stages.map.stage import MapBothArms
from besman.stages.map.whole_tasks import MapAmongBoards, MapTasks
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.model_files import load_model
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.recognize.stage import RecognizeMethod
from besman.stages.refine.stage import check_tool_name
from besman.stages.refine.whole_tasks import AimTasks, RefineTasks, SimulateTasks
from besman.stages.select.block_steps import DivideActions, FindActions
from besman.work.display import Display
from besman.work.outcome import describe_error
from besman.work.stopping import last_words
from besman.work.workers import Workers


def run_pipeline(
    config: PipelineConfig,
    folder: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    fresh: str | None = None,
    display: Display | None = None,
    trained_in: Path | None = None,
    workers: Workers | None = None,
) -> Path:
    """Run every stage that is not cached, and write results and exports.

    Parameters
    ----------
    config : PipelineConfig
        The recipe.
    folder : Path
        The run folder; made if need be.
    jobs : int
        Threads or processes to use; never changes a result.
    cluster : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``; its workers map and refine.
    fresh : str, optional
        Stage to compute anew.
    display : callable, optional
        Shows progress.
    trained_in : Path, optional
        A finished run whose trained model is used in place of labelled examples.
    workers : Workers, optional
        Processes that are there already, for as many jobs; they stay.

    Returns
    -------
    Path
        The run folder.

    Raises
    ------
    BesmanError
        As the stages say. The run's status is then ``failed``.
    """
    from threadpoolctl import threadpool_limits

    if fresh is not None and fresh not in STAGES:
        raise RunError(f"--fresh: no stage {fresh!r}; {nearest(fresh, STAGES)}")
    own = nullcontext(workers) if workers is not None else Workers(jobs, cluster, PRELOAD)
    with own as workers:
        # What leads nowhere is said before anything is written: a slip costs no finished run.
        _check_arms(config)
        clock = Clock()
        inputs = read_inputs(
            config.recordings, learn_from(config), config.read, config.select.landing
        )
        taught = _read_examples(config, inputs, trained_in)
        run = Run(folder, config.name, jobs=jobs, fresh=fresh, display=display, workers=workers)
        with _ends_in_order(run):
            run.start(pipeline_yaml(config), inputs.checksums)
            run.record_time(clock.row("read", Items(len(inputs.recordings), "recordings")))
            # Many small matrices: threads inside BLAS cost more than they bring.
            with threadpool_limits(limits=1, user_api="blas"):
                _run_stages(config, run, inputs, taught, trained_in)
            run.finish()
    return folder


@contextmanager
def _ends_in_order(run: Run) -> Iterator[None]:
    """Have a run that ends badly say why, and let go of its folder."""
    try:
        with last_words(lambda why: run.finish("failed", why)):
            yield
    except BaseException as error:
        # Where nothing can be written, what stopped the run is said all the same.
        with suppress(FileError):
            run.finish("failed", describe_error(error))
        raise


STAGES = (
    "label",
    "segment",
    "label_training",
    "train",
    "recognize",
    "train_actions",
    "compose",
    "actions",
    "select",
    "blocks",
    "select_second",
    "map",
    "tasks",
    "task_plans",
    "aim",
    "simulate",
    "refine_tasks",
    "imitate",
    "refine",
    "robustness",
    "imitate_second",
    "refine_second",
    "robustness_second",
)
"""What ``--fresh`` can compute anew: all that `_run_stages` and what it calls may do."""


def _run_stages(
    config: PipelineConfig,
    run: Run,
    inputs: Inputs,
    taught: Inputs | None,
    trained_in: Path | None,
) -> None:
    """Run the stages in their order."""
    markers = load_marker_set(config.label.markers)
    inputs, left_out = keep_usable(config.label, inputs, markers)
    run.know(_known_truth(config, inputs))
    labelled = run.step("label", config.label, inputs.recordings, markers, inputs.teacher)
    if left_out:
        run.results["label"]["left_out"] = left_out
    segments = run.step("segment", config.segment, labelled)
    examples = _find_examples(config, run, inputs, taught, labelled)
    if isinstance(config.recognize, OneThrowConfig):
        found = run.step("recognize", config.recognize, labelled, segments)
    else:
        model = _learn_blocks(config, config.recognize, run, examples, trained_in)
        found = run.step("recognize", config.recognize, labelled, segments, model)
    if config.compose is not None:
        levels = _learn_actions(config, run, examples, trained_in)
        actions = run.step("compose", config.compose, labelled, found, levels)
    whole = found
    if config.select.action is not None:
        name = config.select.wanted[0]
        if config.compose is not None and name not in config.select.actions:
            whole = pick_level(actions, config.compose, name)
        else:
            whole = run.step(
                "actions", FindActions(config.select), labelled, found, _by_hand(inputs)
            )
    hands = run.step("select", config.select, labelled, whole, inputs.landings)
    if config.select.as_ == "blocks":
        divide = DivideActions(config.select)
        divided = run.step("blocks", divide, labelled, found, whole, hands, markers)
        hands = tuple(one.hand for one in divided)
    robot = load_robot(config.robot, config.tool)
    if config.second_arm is None:
        if config.select.as_ == "blocks" and is_whole_task(config.task):
            among = MapAmongBoards(config.map)
            mapping = run.step("map", among, divided, robot, load_whole_task(config.task))
        else:
            mapping = run.step("map", config.map, hands, robot)
        if config.select.as_ == "blocks":
            tasks = run.step("tasks", MapTasks(config.map), mapping, divided, robot)
            plans = run.step("task_plans", ImitateTasks(config.imitate), tasks, robot)
            if is_whole_task(config.task):
                _try_tasks(config, run, plans, robot)
                return
            run.export("exports_tasks", plans, robot, write_task_exports)
        _learn_motions(config, run, mapping.trajectories, robot)
        return

    others = run.step("select_second", config.select.other_arm, labelled, whole, ())
    second = load_robot(config.second_arm.robot, config.second_arm.tool)
    both = run.step("map", MapBothArms(config.map), hands, others, robot, second)
    for mapping, arm, name in zip(both, (robot, second), ("", "_second"), strict=True):
        _learn_motions(config, run, mapping.trajectories, arm, name)


def _learn_motions(
    config: PipelineConfig,
    run: Run,
    trajectories: tuple[JointTrajectory, ...],
    robot: Robot,
    arm: str = "",
) -> None:
    """Imitate what was mapped to an arm, refine it, and export it."""
    task, refine = load_task(config.task), config.refine
    plans = run.step(f"imitate{arm}", config.imitate, trajectories, robot)
    motions = run.step(f"refine{arm}", refine.without_robustness, plans, robot, task)
    for name, why in run.results[f"refine{arm}"]["handed_over"].items():
        run.note(f"refine{arm}: {name}: CMA-ES has gone on: {why}")
    if refine.robustness is not None:
        run.step(f"robustness{arm}", refine.robustness, motions, robot, task)
        run.results[f"refine{arm}"]["robustness"] = run.results.pop(f"robustness{arm}")
    run.export(f"exports{arm}", motions, robot)


def _try_tasks(config: PipelineConfig, run: Run, plans: tuple[TaskPlan, ...], robot: Robot) -> None:
    """Bring whole tasks to the gripper, try them in simulation, and export them."""
    task = load_whole_task(config.task)
    aimed = run.step("aim", AimTasks(config.refine), plans, robot, task)
    trials = run.step("simulate", SimulateTasks(config.refine), aimed, plans, robot, task)
    refine = RefineTasks(config.refine)
    refined = run.step("refine_tasks", refine, aimed, trials, plans, robot, task)
    run.export("exports_tasks", tuple(one.plan for one in refined), robot, write_task_exports)


def _check_arms(config: PipelineConfig) -> None:
    """Refuse robots and tools that are not there, and tools that are not the task's."""
    if is_whole_task(config.task):
        check_whole_task(config)
        return
    task = load_task(config.task)
    for arm in (config, config.second_arm):
        if arm is not None:
            robot = find_tool(arm.robot, arm.tool)
            check_tool_name(robot.name, arm.tool, task)


def _by_hand(inputs: Inputs) -> tuple[LabelledSegments, ...]:
    """Return the manual segments on layers of actions."""
    manual = [one for one in inputs.truth if one is not None]
    found = [actions_of(one) for one in manual]
    # Where no layer is one of actions, what was given comes back.
    return tuple(one for one, given in zip(found, manual, strict=True) if one is not given)


def _known_truth(config: PipelineConfig, inputs: Inputs) -> Truth:
    """Return what is known of the recordings beforehand."""
    side = side_of(config.segment.markers)
    blocks = leave_out_actions(inputs.truth, config.compose, side)
    return Truth(blocks, inputs.names, config.margin_s)


Examples = tuple[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...]]
"""Recordings, and the manual segments of those that have some."""


def _read_examples(
    config: PipelineConfig, inputs: Inputs, trained_in: Path | None
) -> Inputs | None:
    """Return the recordings to learn from, if there is anything to learn.

    A class to select that is not known is refused.
    """
    if config.recognize.model is not None:
        count_model(config)
    if trained_in is not None or needs_no_examples(config):
        return None
    if config.training:
        inputs = read_inputs(config.training, learn_from(config), config.read)
    count_examples(config, inputs)
    return inputs


def _find_examples(
    config: PipelineConfig,
    run: Run,
    inputs: Inputs,
    taught: Inputs | None,
    labelled: tuple[LabelledRecording, ...],
) -> Examples:
    """Return what can be learnt from; nothing where all that is to be learnt is known."""
    if taught is None:
        return (), ()
    if config.training:
        markers = load_marker_set(config.label.markers)
        known = (taught.recordings, markers, taught.teacher)
        labelled = run.prepare("label_training", config.label, *known)
    else:
        # Those that are usable; none of them may have examples.
        taught = inputs
        count_examples(config, inputs)
    return labelled, tuple(segments for segments in taught.truth if segments is not None)


def _learn_blocks(
    config: PipelineConfig,
    recognize: RecognizeMethod,
    run: Run,
    examples: Examples,
    trained_in: Path | None,
) -> RecognitionModel:
    """Return the trained model: a file's, another run's, or one of the labelled examples."""
    if recognize.model is not None:
        return load_model(Path(recognize.model))
    if trained_in is not None:
        model: RecognitionModel = trained_model(trained_in)
        return model
    labelled, manual = examples
    blocks = leave_out_actions(manual, config.compose, side_of(config.segment.markers))
    known = tuple(one for one in blocks if one is not None)
    return run.prepare("train", recognize.training, labelled, known)


def _learn_actions(
    config: PipelineConfig, run: Run, examples: Examples, trained_in: Path | None
) -> tuple[LevelModel, ...]:
    """Return the actions of every level: another run's, or those of the labelled examples."""
    if trained_in is not None:
        levels: tuple[LevelModel, ...] = trained_model(trained_in, "train_actions")
        return levels
    assert config.compose is not None
    return run.prepare("train_actions", config.compose.training, *examples)
