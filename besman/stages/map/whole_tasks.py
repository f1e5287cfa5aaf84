"""What a mapped movement leaves open of a whole task: objects, borders and grasps on its clock."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.config.stage import Items, Truth, Work
from besman.geometry.frames import quaternion_to_rotation
from besman.records import BlockDemonstration, MappedTask
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.stages.map.demonstration import tool_poses
from besman.stages.map.mapping import Mapping
from besman.stages.map.stage import MapConfig, map_results


class MapAmongBoards:
    """Maps the hands' ways of whole actions among the boards and boxes of their task.

    Parameters
    ----------
    config : MapConfig
    """

    def __init__(self, config: MapConfig) -> None:
        self.config = config

    def run(
        self,
        demonstrations: tuple[BlockDemonstration, ...],
        robot: Robot,
        task: RearrangeConfig,
        work: Work = Work(),
    ) -> Mapping:
        """Return what `MapConfig.run` does, clear of what stands around where that can be.

        Parameters
        ----------
        demonstrations : tuple of BlockDemonstration
        robot : Robot
            With the task's gripper.
        task : RearrangeConfig
        work : Work
        """
        from besman.simulation.tasks.rearrange.shown_scene import list_scenes
        from besman.stages.map.map_demonstrations import map_embodiment

        tools = [tool_poses(one.hand, robot) for one in demonstrations]
        scenes = list_scenes(demonstrations, tools, task)
        hands = tuple(one.hand for one in demonstrations)
        return map_embodiment(hands, robot, self.config.settings, work, scenes)

    def items(self, demonstrations: tuple[BlockDemonstration, ...], *records: Any) -> Items:
        """Count the demonstrations."""
        return Items(len(demonstrations), "demos")

    def figures(self, mapping: Mapping, truth: Truth, *records: Any) -> dict[str, Any]:
        """Return how well the arm can follow; see `besman.stages.map.stage.map_results`."""
        return map_results(mapping)


class MapTasks:
    """Brings the objects of whole actions through the placement of the hand's way.

    Parameters
    ----------
    config : MapConfig
    """

    def __init__(self, config: MapConfig) -> None:
        self.config = config

    def run(
        self,
        mapping: Mapping,
        demonstrations: tuple[BlockDemonstration, ...],
        robot: Robot,
        work: Work = Work(),
    ) -> tuple[MappedTask, ...]:
        """Return a task for each trajectory.

        Parameters
        ----------
        mapping : Mapping
            Of the demonstrations' hands.
        demonstrations : tuple of BlockDemonstration
        robot : Robot
        work : Work
        """
        by_name = {one.name: one for one in demonstrations}
        return tuple(
            map_task(by_name[one.name], one, robot, mapping.scale) for one in mapping.trajectories
        )

    def items(self, mapping: Mapping, *records: Any) -> Items:
        """Count the trajectories."""
        return Items(len(mapping.trajectories), "tasks")

    def figures(self, tasks: tuple[MappedTask, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return when each task grasps and releases, on the robot's clock."""
        return {
            "n_tasks": len(tasks),
            "holds_s": {task.name: task.holds_s.tolist() for task in tasks},
        }


def map_task(
    demonstration: BlockDemonstration, trajectory: Any, robot: Robot, scale: float = 1.0
) -> MappedTask:
    """Bring the objects of an action to where its mapped movement is.

    The placement is told from the pose that was asked of the tool at the first sample, so that a
    movement with a placement of its own takes its objects along.

    Parameters
    ----------
    demonstration : BlockDemonstration
    trajectory : JointTrajectory
        Of its hand: as many samples, time stretched evenly.
    robot : Robot
        With the tool that was mapped for.
    scale : float
        By which movements were made smaller or larger.
    """
    asked = tool_poses(demonstration.hand, robot)[0]
    placed = quaternion_to_rotation(trajectory.poses[0, 3:])
    back2world = placed @ asked[:3, :3].T
    apart = demonstration.object_positions - asked[:3, 3]
    stretch = trajectory.time[-1] / demonstration.hand.time[-1]
    opening = demonstration.opening_m
    return MappedTask(
        trajectory,
        demonstration.labels,
        demonstration.bounds_s * stretch,
        demonstration.objects,
        trajectory.poses[0, :3] + scale * apart @ back2world.T,
        demonstration.object_headings + np.arctan2(back2world[1, 0], back2world[0, 0]),
        demonstration.holds_s * stretch,
        demonstration.held,
        float(np.nanmax(opening)) if np.isfinite(opening).any() else 0.0,
    )
