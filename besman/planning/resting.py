"""Where an arm rests before and after the legs of a plan, clear of what stands there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.records import TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.boxes import board_pose
from besman.simulation.tasks.rearrange.clearance import Surroundings
from besman.simulation.tasks.rearrange.detours import list_changes
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.ways import CLEAR_M

FloatArray = npt.NDArray[np.float64]

# Beside what stands there it is so far from everything, where it can, so that it comes away.
_ROOM_M = 0.03


def shown_rests(plans: Sequence[TaskPlan]) -> FloatArray:
    """Return where the arm has rested before and after tasks, each once, shape (R, n), rad."""
    ends = [(plan.blocks[0].start, plan.blocks[-1].goal) for plan in plans]
    return np.unique(np.concatenate(ends), axis=0)


class ClearRests:
    """Where the arm can rest without touching anything.

    Parameters
    ----------
    name : str
        Of the task, for the message.
    shown : array, shape (R, n)
        Of `shown_rests`.
    places : sequence of array, shape (7,)
        Of boards besides those below what stands there.
    robot : Robot
    task : RearrangeConfig
    """

    def __init__(
        self,
        name: str,
        shown: FloatArray,
        places: Sequence[FloatArray],
        robot: Robot,
        task: RearrangeConfig,
    ) -> None:
        self._name, self._shown, self._places = name, shown, places
        self._robot, self._task = robot, task
        self._known: dict[bytes, FloatArray] = {}

    def beside(self, standing: FloatArray) -> FloatArray:
        """Return the rests beside what stands there.

        Parameters
        ----------
        standing : array, shape (O, 7)
            Middles of objects, in the world.

        Returns
        -------
        array, shape (K, n)
            Those that were shown, if any is clear; if none is, those near them that are: the tool
            up to 30 cm aside, or one joint turned.

        Raises
        ------
        PlanError
            If there is none.
        """
        key = standing.tobytes()
        if key not in self._known:
            self._known[key] = self._find(standing)
        return self._known[key]

    def _find(self, standing: FloatArray) -> FloatArray:
        shown, robot, task = self._shown, self._robot, self._task
        boards = np.stack([board_pose(pose, task) for pose in (*standing, *self._places)])
        around = Surroundings(robot, task, standing, standing, boards)
        gaps = around.gaps_before(shown)
        if np.any(gaps >= CLEAR_M):
            return shown[gaps >= CLEAR_M]
        aside = np.concatenate([rest + list_changes(rest, robot) for rest in shown])
        low, high = robot.limits.position_min, robot.limits.position_max
        aside = aside[np.all((aside >= low) & (aside <= high), axis=1)]
        room = around.gaps_before(aside)
        found: FloatArray = aside[room >= min(_ROOM_M, max(CLEAR_M, room.max(initial=-np.inf)))]
        if not len(found):
            raise PlanError(
                f"{self._name}: wherever the arm was shown to rest ({len(shown)} postures), and 30 "
                f"cm beside it, it would touch what stands there, by {-1e3 * gaps.max():.0f} mm at "
                "least; expected objects and places beside it"
            )
        return found


def nearest_rest(shown: FloatArray, clear: FloatArray) -> FloatArray:
    """Return the rest that is nearest to one that was shown, shape (n,): that itself, if clear."""
    return np.asarray(clear[int(np.linalg.norm(clear - shown, axis=1).argmin())])


def rest_clear(plan: TaskPlan, clear: FloatArray, robot: Robot) -> TaskPlan:
    """Let the last block of a leg lead to a clear rest, if it leads to one in the world."""
    last = plan.blocks[-1]
    if last.frame != "world":
        return plan
    goal = nearest_rest(last.goal, clear)
    if np.array_equal(goal, last.goal):
        return plan
    pose = forward_kinematics(robot.chain, goal[np.newaxis])[0]
    at = np.concatenate([pose[:3, 3], rotation_to_quaternion(pose[None, :3, :3])[0]])
    return replace(plan, blocks=(*plan.blocks[:-1], replace(last, goal=goal, goal_pose=at)))
