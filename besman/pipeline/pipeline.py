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
    SecondArmConfig,
    check_whole_task,
    learn_from,
    pipeline_yaml,
)
from besman.pipeline.learning import (
    LabelledTakes,
    find_examples,
    learn_levels,
    learn_names,
    read_examples,
)
from besman.pipeline.preload import PRELOAD
from besman.pipeline.run_folder import Run
from besman.pipeline.usable_inputs import keep_usable
from besman.records import (
    BlockDemonstration,
    HandTrajectory,
    JointTrajectory,
    LabelledRecording,
    LabelledSegments,
    Segments,
    TaskPlan,
)
from besman.records.layers import actions_of, side_of
from besman.robot.model import Robot, find_tool, load_robot
from besman.simulation.tasks.kinds import is_whole_task, load_task, load_whole_task
from besman.stages.compose.stage import leave_out_actions, pick_level
from besman.stages.map.stage import MapBothArms
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.refine.stage import check_tool_name
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
        taught = read_examples(config, inputs, trained_in)
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
    """Run the stages in their order, from what was read to what an arm takes."""
    markers = load_marker_set(config.label.markers)
    inputs, left_out = keep_usable(config.label, inputs, markers)
    run.know(_known_truth(config, inputs))
    labelled = run.step("label", config.label, inputs.recordings, markers, inputs.teacher)
    if left_out:
        run.results["label"]["left_out"] = left_out
    segments = run.step("segment", config.segment, labelled)
    examples = find_examples(config, run, inputs, taught, labelled)
    found = _recognize(config, run, labelled, segments, examples, trained_in)
    whole = _find_actions(config, run, labelled, found, examples, trained_in, inputs)
    hands = run.step("select", config.select, labelled, whole, inputs.landings)
    if config.select.as_ == "blocks":
        divide = DivideActions(config.select)
        divided = run.step("blocks", divide, labelled, found, whole, hands, markers)
        _learn_tasks(config, run, divided)
    elif config.second_arm is not None:
        others = run.step("select_second", config.select.other_arm, labelled, whole, ())
        _learn_both_arms(config, run, hands, others, config.second_arm)
    else:
        robot = load_robot(config.robot, config.tool)
        mapping = run.step("map", config.map, hands, robot)
        _learn_motions(config, run, mapping.trajectories, robot)


def _recognize(
    config: PipelineConfig,
    run: Run,
    labelled: tuple[LabelledRecording, ...],
    segments: tuple[Segments, ...],
    examples: LabelledTakes,
    trained_in: Path | None,
) -> tuple[LabelledSegments, ...]:
    """Name the segments."""
    if isinstance(config.recognize, OneThrowConfig):
        return run.step("recognize", config.recognize, labelled, segments)
    model = learn_names(config, config.recognize, run, examples, trained_in)
    return run.step("recognize", config.recognize, labelled, segments, model)


def _find_actions(
    config: PipelineConfig,
    run: Run,
    labelled: tuple[LabelledRecording, ...],
    found: tuple[LabelledSegments, ...],
    examples: LabelledTakes,
    trained_in: Path | None,
    inputs: Inputs,
) -> tuple[LabelledSegments, ...]:
    """Return the segments of the action that is asked for; the blocks themselves if none is."""
    if config.compose is not None:
        levels = learn_levels(config, run, examples, trained_in)
        actions = run.step("compose", config.compose, labelled, found, levels)
    if config.select.action is None:
        return found
    name = config.select.wanted[0]
    if config.compose is not None and name not in config.select.actions:
        return pick_level(actions, config.compose, name)
    return run.step("actions", FindActions(config.select), labelled, found, _by_hand(inputs))


def _learn_tasks(config: PipelineConfig, run: Run, divided: tuple[BlockDemonstration, ...]) -> None:
    """Map movements that are divided into blocks, imitate them block by block, and go on.

    A whole task is tried in simulation; of any other, the movements are refined as one.
    """
    from besman.stages.export.task_exports import write_task_exports
    from besman.stages.imitate.task_plans import ImitateTasks
    from besman.stages.map.whole_tasks import MapAmongBoards, MapTasks

    robot = load_robot(config.robot, config.tool)
    whole = is_whole_task(config.task)
    if whole:
        among = MapAmongBoards(config.map)
        mapping = run.step("map", among, divided, robot, load_whole_task(config.task))
    else:
        mapping = run.step("map", config.map, tuple(one.hand for one in divided), robot)
    tasks = run.step("tasks", MapTasks(config.map), mapping, divided, robot)
    plans = run.step("task_plans", ImitateTasks(config.imitate), tasks, robot)
    if whole:
        _try_tasks(config, run, plans, robot)
    else:
        run.export("exports_tasks", plans, robot, write_task_exports)
        _learn_motions(config, run, mapping.trajectories, robot)


def _learn_both_arms(
    config: PipelineConfig,
    run: Run,
    hands: tuple[HandTrajectory, ...],
    others: tuple[HandTrajectory, ...],
    other: SecondArmConfig,
) -> None:
    """Map a person's two hands to two arms at once, and go on with each arm."""
    arms = load_robot(config.robot, config.tool), load_robot(other.robot, other.tool)
    both = run.step("map", MapBothArms(config.map), hands, others, *arms)
    for mapping, arm, name in zip(both, arms, ("", "_second"), strict=True):
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
    from besman.stages.export.task_exports import write_task_exports
    from besman.stages.refine.whole_tasks import AimTasks, RefineTasks, SimulateTasks

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
