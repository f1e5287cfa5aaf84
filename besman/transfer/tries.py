"""Tries on the real arm: suggested, written as files, and recorded, in a run folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import TransferError, nearest
from besman.io.atomic_files import check_folder, make_folder
from besman.motion.rollout import sample_plan
from besman.pipeline.finished_run import FinishedRun, read_run
from besman.records import AnyPlan, RefinedMotion
from besman.records.files import digest
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot, load_robot
from besman.search.protocol import Part
from besman.simulation.tasks.kinds import KINDS
from besman.simulation.tasks.stick_throw.throw_and_flight import ThrowConfig
from besman.simulation.trial import try_plans
from besman.stages.export.motion_exports import write_exports
from besman.stages.refine.plan_space import Space, plan_space
from besman.transfer.approach import TransferConfig
from besman.transfer.archive import Simulator
from besman.transfer.calibration import Touchdown, calibrated, landings_of
from besman.transfer.newton import suggest_next
from besman.transfer.results_table import add_row, read_results
from besman.transfer.state import Suggested, TransferState, load_state, new_state, save_state

FloatArray = npt.NDArray[np.float64]

PARTS: tuple[Part, ...] = ("goal", "duration", "weights")


@dataclass(frozen=True)
class Suggestion:
    """What to try next.

    Attributes
    ----------
    state : TransferState
        With the try as its last.
    target : array, shape (2,)
        On the floor, metres.
    folder : Path
        Of the files to run.
    table : Path
        Where the outcome is to be filled in.
    anew : bool
        Whether tries before were simulated anew, because the arm is known otherwise than then.
    told_by : tuple of str
        The motions, one a landing, that have told the model it was found in; none: the run's own.
    """

    state: TransferState
    target: FloatArray
    folder: Path
    table: Path
    anew: bool = False
    told_by: tuple[str, ...] = ()


def suggest_try(
    run: Path,
    motion: str | None = None,
    out: Path | None = None,
    config: TransferConfig | None = None,
    jobs: int = 1,
    robot: str | None = None,
    progress: Callable[[float], None] = lambda done: None,
) -> Suggestion:
    """Suggest the next try of a motion, and write it in every format.

    A try that is not recorded yet is written again. The next one is found in the model that all
    landings tell which are recorded of the run, whichever motion's they are.

    Parameters
    ----------
    run : Path
        A finished run of a throw.
    motion : str, optional
        Name of a refined motion; default the first.
    out : Path, optional
        Folder for files and table; default ``transfer`` in the run folder.
    config : TransferConfig, optional
        How to search. What the first try of a motion was found with stays: what is set here must
        be the same.
    jobs : int
        Threads; they change nothing.
    robot : str, optional
        The run's arm as it is known by now, see
        `besman.transfer.identification.identify.identify_arm`; default as the run has it. What
        was tried stays, and is simulated anew.
    progress : callable
        Called with the share done, 0 to 1.

    Raises
    ------
    RunError, TransferError
        If the robot is another arm, the folder is no finished run of a throw, there is no such
        motion, or none may be tried.
    """
    finished = _throws(run)
    if robot is not None:
        finished = replace(finished, robot=_same_arm(finished.robot, robot))
    refined = _choose(run, finished, motion)
    config = config or TransferConfig()
    space = _space(refined.plan, finished.robot, config)
    folder = run / "transfer" / file_name(refined.plan.name)
    check_folder(out or run / "transfer")
    state = new_state(refined, space.dimension, config)
    if (folder / "state.json").exists():
        state = _same(folder, load_state(folder), refined)
        _refuse_other_search(folder, state, config)
        space = _space(refined.plan, finished.robot, state.config)
    target = refined.plan.target[:2]
    simulator = Simulator(space, finished.robot, finished.task)
    before = state.drives if state.tries else digest(simulator.robot.drives)
    state = _simulated_by(state, simulator, jobs)
    told: list[Touchdown] = []
    if not state.tries or state.tries[-1].recorded:
        told = _landings(run, finished, state) if state.config.surrogate == "jacobian" else []
        model = calibrated(simulator, told, jobs, lambda done: progress(0.8 * done))
        state = _next(state, simulator, target, jobs, model)
        save_state(folder, state)
    number = len(state.tries)
    place = (out or run / "transfer") / file_name(refined.plan.name) / f"try_{number:02d}"
    make_folder(place)
    plan = space.plan_at(state.archive.points[state.tries[-1].row])
    write_exports((_as_motion(refined, plan, finished, number),), finished.robot, place)
    table = (out or run / "transfer") / "results.csv"
    add_row(table, refined.plan.name, number)
    told_by = tuple(landing.plan.name for landing in told)
    return Suggestion(state, target, place, table, before not in ("", state.drives), told_by)


def _landings(run: Path, finished: FinishedRun, state: TransferState) -> list[Touchdown]:
    """Return where all motions of a run came down that were tried, that of the state last."""
    motions = {one.plan.name: one for one in finished.motions}
    paths = sorted((run / "transfer").glob("*/state.json"))
    others = [load_state(path.parent) for path in paths]
    landings = []
    for one in [*(other for other in others if other.motion != state.motion), state]:
        refined = motions.get(one.motion)
        # Of a motion that was computed anew since, nobody knows any more what was tried.
        if refined is not None and one.key == digest(refined.plan):
            space = _space(refined.plan, finished.robot, one.config)
            landings += landings_of(space, one.archive, one.real_tries)
    return landings


def record_tries(run: Path, table: Path) -> list[tuple[TransferState, FloatArray]]:
    """Take what was measured.

    Parameters
    ----------
    run : Path
        The run whose motions were tried.
    table : Path
        See `besman.transfer.results_table`.

    Returns
    -------
    list of pairs
        Of every motion in the table its state and its target (2,), metres.

    Raises
    ------
    RunError, TransferError
        If nothing was suggested for the run, or the table does not fit; then nothing is recorded.
    """
    finished = _throws(run)
    motions = {one.plan.name: one for one in finished.motions}
    states = {}
    for path in sorted((run / "transfer").glob("*/state.json")):
        state = load_state(path.parent)
        if state.motion in motions:
            states[state.motion] = _same(path.parent, state, motions[state.motion])
    if not states:
        raise TransferError(f"{run}: nothing was suggested yet; first: besman transfer suggest")
    changed: dict[str, TransferState] = {}
    for row in read_results(table, {name: len(one.tries) for name, one in states.items()}):
        before = changed.get(row.motion, states[row.motion])
        changed[row.motion] = before.record(row.number, row.outcome)
    for name, state in changed.items():
        save_state(run / "transfer" / file_name(name), state)
    return [(state, motions[name].plan.target[:2]) for name, state in changed.items()]


def miss_distances(state: TransferState, target: FloatArray) -> list[float | None]:
    """Return how far from the target every try came down, metres; None if it is not known."""
    return [
        None if one.outcome_m is None else float(np.linalg.norm(np.array(one.outcome_m) - target))
        for one in state.tries
    ]


def file_name(motion: str) -> str:
    """Return a motion's name for files: ``FILE_SEGMENT``."""
    source, _, segment = motion.rpartition(":")
    return f"{Path(source).stem}_{segment}"


def _throws(run: Path) -> FinishedRun:
    """Read a run, if it is one of a throw."""
    finished = read_run(run)
    if not isinstance(finished.task, ThrowConfig):
        raise TransferError(
            f"{run}: task {finished.task.kind}: transfer is for throws; "
            f"{nearest(finished.task.kind, _throw_kinds())}"
        )
    return finished


def _throw_kinds() -> list[str]:
    """Return the kinds of tasks in which something is thrown."""
    return [entry.name for entry in KINDS if issubclass(entry.load(), ThrowConfig)]


def _choose(run: Path, finished: FinishedRun, motion: str | None) -> RefinedMotion:
    """Return the motion of a name."""
    motions = {one.plan.name: one for one in finished.motions}
    if not motions:
        raise TransferError(f"{run}: no motion was refined")
    if motion is None:
        return finished.motions[0]
    if motion not in motions:
        raise TransferError(f"--motion: got {motion!r}; {nearest(motion, motions)}")
    return motions[motion]


def _space(plan: AnyPlan, robot: Robot, config: TransferConfig) -> Space:
    """Set up the motions around a refined one."""
    return plan_space(plan, robot, PARTS, config.n_shapes)


def _same(folder: Path, state: TransferState, motion: RefinedMotion) -> TransferState:
    """Refuse what was learnt about a motion that the run no longer holds."""
    if state.key != digest(motion.plan):
        raise TransferError(
            f"{folder}: belongs to another motion {state.motion}: the run was computed anew since; "
            "move the folder away to begin again"
        )
    return state


def _refuse_other_search(folder: Path, state: TransferState, config: TransferConfig) -> None:
    """Refuse to search in another way than a motion's first try was found."""
    for key in sorted(config.model_fields_set):
        had, got = getattr(state.config, key), getattr(config, key)
        if had != got:
            raise TransferError(
                f"--{key.replace('_', '-')}: got {got}; the tries of {state.motion} began with "
                f"{had}, which stays; expected that or none, or move {folder} away to begin again"
            )


def _same_arm(robot: Robot, source: str) -> Robot:
    """Load an arm that may differ from a run's in its drives alone."""
    other = load_robot(source, robot.tool.name)
    parts = ("placements", "axes", "tip")
    same = other.joint_names == robot.joint_names and all(
        np.array_equal(getattr(other.chain, part), getattr(robot.chain, part)) for part in parts
    )
    if not same:
        raise TransferError(
            f"--robot: {source} is another arm than the run's {robot.name}; expected what besman "
            "identify wrote for it"
        )
    return other


def _simulated_by(state: TransferState, simulator: Simulator, jobs: int) -> TransferState:
    """Return a state whose tries were simulated with an arm as it is known now."""
    known = digest(simulator.robot.drives)
    if state.drives == known:
        return state
    if not len(state.archive.points):
        return replace(state, drives=known)
    rows = np.array([one.row for one in state.tries], dtype=np.int64)
    archive = simulator.simulate(state.archive.points[rows], jobs)
    tries = tuple(replace(one, row=row) for row, one in enumerate(state.tries))
    return replace(state, archive=archive, tries=tries, drives=known)


def _next(
    state: TransferState,
    simulator: Simulator,
    target: FloatArray,
    jobs: int,
    model: Simulator | None,
) -> TransferState:
    """Return the state with one try more."""
    tried = state.real_tries
    found = suggest_next(
        simulator, state.archive, tried, target, state.config, simulator.keeps_limits, jobs, model
    )
    expected = (float(found.landing[0]), float(found.landing[1]))
    tries = (*state.tries, Suggested(found.row, expected))
    return replace(state, archive=found.archive, tries=tries)


def _as_motion(
    refined: RefinedMotion, plan: AnyPlan, finished: FinishedRun, number: int
) -> RefinedMotion:
    """Return a plan as a motion that can be written."""
    plan = replace(plan, name=f"{plan.name}_try{number:02d}")
    (trial,) = try_plans(finished.robot, finished.task, [plan], paths=True)
    time, positions, velocities, accelerations = sample_plan(plan, finished.robot)
    return replace(
        refined,
        plan=plan,
        time=time,
        positions=positions,
        velocities=velocities,
        accelerations=accelerations,
        outcome=trial.outcome,
        object_path=trial.object_path,
        tool_path=forward_kinematics(finished.robot.chain, positions)[:, :3, 3],
        success=trial.success,
        miss=trial.miss,
    )
