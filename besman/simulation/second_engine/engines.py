"""Which second engines there are, which tasks they know, and what a plan comes to in one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from besman.exceptions import VerificationError, nearest, one_of
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.second_engine.drake_scene import ContactModel, load_drake
from besman.simulation.task import Task
from besman.simulation.trial import Trial, score_episodes

if TYPE_CHECKING:
    from besman.simulation.episodes import Episodes, Movements

ENGINES = ("drake",)
"""Engines that tasks can be tried in besides MuJoCo."""

VERIFIED_KINDS = ("ball_throw", "pull_lever", "stick_throw")
"""Kinds of tasks that the engines know."""


def check_engine(engine: str, task: Task) -> None:
    """Refuse an engine that is not there, and a task that it does not know.

    Raises
    ------
    VerificationError
        If there is no such engine, it is not installed, or does not know the task's kind.
    """
    if engine not in ENGINES:
        raise VerificationError(f"--engine: got {engine!r}; {nearest(engine, ENGINES)}")
    if task.kind not in VERIFIED_KINDS:
        raise VerificationError(
            f"verify: got a run of task {task.kind}; {engine} knows {one_of(VERIFIED_KINDS)}"
        )
    load_drake()


def try_in_second_engine(
    robot: Robot, task: Task, plan: AnyPlan, contact: ContactModel = ContactModel()
) -> Trial:
    """Try a motion plan in Drake, as `besman.simulation.trial.try_plans` does in MuJoCo.

    The same movement, servos and criteria; arm, tool and what they touch are built anew.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : Task
        Of one of `VERIFIED_KINDS`.
    plan : MotionPlan or CartesianPlan
    contact : ContactModel
        What of contacts the task does not say.

    Raises
    ------
    VerificationError
        If Drake cannot simulate it.
    """
    movements = task.move([plan], robot)
    episodes = _simulate(robot, task, plan, movements, contact)
    return score_episodes(robot, task, [plan], movements, episodes)[0]


def _simulate(
    robot: Robot, task: Task, plan: AnyPlan, movements: Movements, contact: ContactModel
) -> Episodes:
    """Perform a movement in Drake."""
    from besman.simulation.second_engine.drake_lever import pull_lever
    from besman.simulation.second_engine.drake_throws import throw_ball, throw_stick
    from besman.simulation.tasks.ball_throw.ball_throw import BallThrowConfig
    from besman.simulation.tasks.pull_lever.pull_lever import PullLeverConfig
    from besman.simulation.tasks.stick_throw.stick_throw import StickThrowConfig

    if isinstance(task, StickThrowConfig):
        return throw_stick(robot, task, movements, contact)
    if isinstance(task, BallThrowConfig):
        return throw_ball(robot, task, movements, contact)
    if isinstance(task, PullLeverConfig):
        return pull_lever(robot, task, plan, movements, contact)
    raise VerificationError(f"verify: got task {task.kind}; expected {one_of(VERIFIED_KINDS)}")
