"""What a run has to show: its demonstrations, and one bundle for each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.yaml_file import read_yaml
from besman.exceptions import MappingError, RunError, nearest
from besman.pipeline.stored_run import StoredRun, open_run
from besman.records import FloatArray, HandTrajectory, JointTrajectory, RefinedMotion
from besman.report.motions import selected_segments
from besman.report.run_records import ArmRecords, arm_records, load_records
from besman.report.terminal import failures
from besman.robot.model import Robot, load_robot
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import is_whole_task, load_task, load_whole_task
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.stages.map.demonstration import tool_poses
from besman.view.outcome_words import motion_words
from besman.view.packing import Packer
from besman.view.person import PersonMarkers, find_person
from besman.view.shapes import robot_content
from besman.view.takes import DemonstrationInPlan, mapped_take, simulated_takes
from besman.view.whole_tasks import WholeTasks

RATE_HZ = 100.0


@dataclass(frozen=True, eq=False)
class ShownArm:
    """One arm of the run.

    Attributes
    ----------
    records : ArmRecords
    robot : Robot
    demonstrations : dict of HandTrajectory
        The hand that it follows, by name.
    trajectories : dict of JointTrajectory
    motions : dict of RefinedMotion
    """

    records: ArmRecords
    robot: Robot
    demonstrations: dict[str, HandTrajectory]
    trajectories: dict[str, JointTrajectory]
    motions: dict[str, RefinedMotion]


class RunContent:
    """A finished run, as a page is given it.

    Parameters
    ----------
    folder : Path
        The run folder.

    Attributes
    ----------
    folder : Path
    names : tuple of str
        Of the demonstrations, in their order.

    Raises
    ------
    RunError
        If the folder is not a run, is not finished, or nothing of it was mapped to an arm.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        run = open_run(folder)
        _check_finished(run)
        self._config, _ = read_yaml(folder / "pipeline.yaml")
        self._records = load_records(folder)
        self._name: str = run.state["name"]
        self._arms = _shown_arms(self._records, self._config)
        if not any(arm.trajectories for arm in self._arms):
            raise RunError(f"{folder}: no demonstration was mapped to an arm: nothing to show")
        self._task, self._whole = _load_tasks(self._config["task"], self._records, self._arms)
        self._sources = [recording.source for recording in self._records["label"]]
        self.names = tuple(dict.fromkeys(name for arm in self._arms for name in arm.demonstrations))
        with run.reading():
            self._left_out = {
                (one["name"], stage): one["reason"]
                for stage, failed in failures(run.read("results.json")).items()
                for one in failed
            }

    def find(self, name: str) -> int:
        """Return the index of a demonstration.

        Raises
        ------
        RunError
            If there is none of this name.
        """
        if name not in self.names:
            raise RunError(f"--motion: no motion {name!r}; {nearest(name, self.names)}")
        return self.names.index(name)

    @property
    def first(self) -> int:
        """The demonstration to begin with: one that succeeds, of those with most to show."""

        def rank(index: int) -> tuple[bool, int]:
            if self._whole is not None:
                found = self._whole.outcome(self.names[index])
                return (found is not None and found["status"] == "success", 0)
            motion = self._arms[0].motions.get(self.names[index])
            return (motion.success, len(motion.milestones)) if motion else (False, -1)

        return max(range(len(self.names)), key=rank)

    def overview(self, chosen: list[int] | None = None, first: int | None = None) -> bytes:
        """Pack what all demonstrations share, and one line for each.

        Parameters
        ----------
        chosen : list of int, optional
            Demonstrations that are there; all if not given.
        first : int, optional
            The one to begin with, an index into `names`.
        """
        packer = Packer()
        chosen = list(range(len(self.names))) if chosen is None else chosen
        first = self.first if first is None else first
        robots = [arm.robot for arm in self._arms]
        task: Task | RearrangeConfig | None = self._task
        radius_m = 0.0 if self._task is None else self._task.success_radius_m
        if self._whole is not None:
            task, radius_m = self._whole.task, self._whole.task.success.success_radius_m
        assert task is not None
        return packer.bundle(
            {
                "run": self._name,
                "task": task.kind,
                "radius": radius_m,
                "robots": [
                    robot_content(robot, packer, [one for one in robots if one is not robot])
                    for robot in robots
                ],
                "sides": [arm.records.side for arm in self._arms],
                "demonstrations": [self._line(self.names[index]) for index in chosen],
                "total": len(self.names),
                "first": chosen.index(first) if first in chosen else 0,
            }
        )

    def _line(self, name: str) -> dict[str, Any]:
        """Say in the list what became of a demonstration: the worst of its arms."""
        lines = [self._outcome(name, arm) for arm in self._arms]
        order = ("left out", "missed", "mapped", "success")
        worst = min(lines, key=lambda line: order.index(line["status"]))
        return {"name": name, **worst}

    def _outcome(self, name: str, arm: ShownArm) -> dict[str, Any]:
        """Say what became of a demonstration on one arm."""
        suffix = arm.records.suffix
        motion = arm.motions.get(name)
        whole = None if self._whole is None else self._whole.outcome(name)
        if whole is not None:
            return whole
        if motion is not None:
            miss = float(motion.miss) if np.isfinite(motion.miss) else None
            status = "success" if motion.success else "missed"
            return {"status": status, "miss": miss, "reason": motion_words(motion)}
        stages = ("select", "map", "imitate", "refine")
        reason = next(
            (
                f"{stage}: {self._left_out[name, stage + suffix]}"
                for stage in stages
                if (name, stage + suffix) in self._left_out
            ),
            "",
        )
        if not reason and name in arm.trajectories:
            return {"status": "mapped", "reason": ""}
        return {"status": "left out", "reason": reason or "not mapped to this arm"}

    def demonstration(self, index: int, rate_hz: float = RATE_HZ) -> bytes:
        """Pack one demonstration: the person, and all takes of every arm.

        Parameters
        ----------
        index : int
            Into `names`.
        rate_hz : float
            Frames per second, at most.

        Raises
        ------
        RunError
            If there is no such demonstration.
        """
        if not 0 <= index < len(self.names):
            raise RunError(f"no demonstration {index}: there are {len(self.names)}")
        name, packer = self.names[index], Packer()
        hand = next(arm for arm in self._arms if name in arm.demonstrations).demonstrations[name]
        person = self._person(hand, rate_hz)
        boxes = [] if self._whole is None else self._whole.boxes(hand, person, packer)
        return packer.bundle(
            {
                "name": name,
                "duration": float(hand.time[-1]),
                "person": person.content(packer) | {"boxes": boxes},
                "arms": [self._arm(name, arm, person, packer, rate_hz) for arm in self._arms],
            }
        )

    def _person(self, hand: HandTrajectory, rate_hz: float) -> PersonMarkers:
        source, _, segment = hand.name.rpartition(":")
        at = self._sources.index(source)
        recording = self._records["label"][at]
        segments = selected_segments(self._records, self._config["select"], at)
        start = int(segments.bounds[int(segment), 0])
        stop = start + round(float(hand.time[-1]) * recording.rate_hz) + 1
        thrown = self._config["select"].get("object")
        return find_person(recording, (start, stop), thrown, rate_hz)

    def _arm(
        self, name: str, arm: ShownArm, person: PersonMarkers, packer: Packer, rate_hz: float
    ) -> dict[str, Any]:
        """Describe what one arm did of a demonstration."""
        hand, mapped = arm.demonstrations.get(name), arm.trajectories.get(name)
        motion = arm.motions.get(name)
        placement = _placement(arm, hand, mapped)
        up = person.back_height_m
        takes = []
        if mapped is not None:
            takes.append(mapped_take(mapped, arm.robot, rate_hz))
        if self._whole is not None:
            takes += self._whole.takes(name, rate_hz)
        elif self._task is not None and mapped is not None and motion is not None:
            settings = self._config["imitate"]
            within = DemonstrationInPlan(
                settings["lead_in_s"], settings["lead_out_s"], float(mapped.time[-1])
            )
            takes += simulated_takes(motion, within, arm.robot, self._task, rate_hz)
        target = np.full(3, np.nan)
        if motion is not None and self._task is not None:
            target = self._task.target(motion.plan)
        return {
            "yaw": float(np.arctan2(placement[1, 0], placement[0, 0])),
            "shift": placement[:3, 3].tolist(),
            "backHeight": up,
            "hand": packer.add(
                np.empty((0, 3)) if hand is None else hand.poses[:, :3] + (0.0, 0.0, up)
            ),
            "path": packer.add(np.empty((0, 3)) if mapped is None else mapped.poses[:, :3]),
            "target": target.tolist() if np.isfinite(target).all() else None,
            "outcome": self._outcome(name, arm),
            "takes": [take.content(packer) for take in takes],
        }


def _load_tasks(
    name: str, records: dict[str, Any], arms: list[ShownArm]
) -> tuple[Task | None, WholeTasks | None]:
    """Load the run's task, which is one of single movements, or of whole actions."""
    if not is_whole_task(name):
        return load_task(name), None
    return None, WholeTasks.of(records, arms[0].robot, load_whole_task(name))


def _check_finished(run: StoredRun) -> None:
    """Refuse a run that has not ended well."""
    if run.status != "done":
        why = f": {run.state['error']}" if run.state.get("error") else ""
        raise RunError(
            f"{run.folder}: the run is not finished (status {run.status!r}{why}); "
            "expected 'done': run it again, and it goes on where it was"
        )


def _shown_arms(records: dict[str, Any], config: dict[str, Any]) -> list[ShownArm]:
    """Load the arms and sort what they did by name."""
    arms = []
    for arm in arm_records(records, config):
        hands = records.get(f"select{arm.suffix}", ())
        arms.append(
            ShownArm(
                records=arm,
                robot=load_robot(arm.config["robot"], arm.config["tool"]),
                demonstrations={one.name: one for one in hands},
                trajectories={one.name: one for one in arm.mapping.trajectories},
                motions={one.plan.name: one for one in arm.motions},
            )
        )
    return arms


def _placement(
    arm: ShownArm, hand: HandTrajectory | None, mapped: JointTrajectory | None
) -> FloatArray:
    """Return the back frame in the robot's world, shape (4, 4), metres.

    A person is not made smaller or larger where the movement was: then the middles agree.
    """
    mapping = arm.records.mapping
    common: FloatArray = np.array(mapping.placement)
    own = any(one.name == (hand.name if hand else "") for one in mapping.corrected)
    if hand is None or mapped is None or not (own or mapping.scale != 1.0):
        return common
    try:
        poses = tool_poses(hand, arm.robot)
    except MappingError:
        return common
    from besman.geometry.frames import quaternion_to_rotation

    turn = quaternion_to_rotation(mapped.poses[0, 3:]) @ poses[0, :3, :3].T
    yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    placement = np.eye(4)
    placement[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    middle = (poses[0, :3, 3] + poses[-1, :3, 3]) / 2
    reached = (mapped.poses[0, :3] + mapped.poses[-1, :3]) / 2
    placement[:3, 3] = reached - placement[:3, :3] @ middle
    return placement
