"""A box on a shelf is approached, gripped by three fingers, and lifted.

The motion plan is the approach. What follows is the task's own: the fingers close, the arm lifts
the box straight up and holds it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import quaternion_to_rotation
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.task import PlacedBy
from besman.simulation.tasks.grasp_box.sections import (
    GraspBoxFields,
)

FloatArray = npt.NDArray[np.float64]

# Where else on the shelf the box is tried, in shares of `spread_m`: ahead, to the left.
_SPREAD = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


class GraspBoxConfig(GraspBoxFields):
    """A box is taken from a shelf; see `GraspBoxFields` for its sections."""

    needs: ClassVar[str] = "demonstrated end pose"
    placed_by: ClassVar[tuple[PlacedBy, ...]] = ("goal_pose",)
    worst: ClassVar[dict[str, float]] = {
        "distance_m": 1.0,
        "tilt_rad": np.pi,
        "contact_finger": 3.0,
    }

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement at least, seconds."""
        lift = self.lift
        return lift.pause_s + lift.closing_s + lift.lift_s + lift.hold_s

    @property
    def fixed_by(self) -> str:
        """The place of the box, if it is given."""
        return "" if self.box.place_m is None else "box.place_m"

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan with the place of the lifted box as its target."""
        target = self._box_poses(plan)[0, :3] + np.array([0.0, 0.0, self.lift.height_m])
        return replace(plan, target=target)

    def search_start(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return a plan that comes to the box straight and square, see `ApproachConfig`."""
        if not self.approach.square:
            return plan
        from besman.motion.square_approach import square_approach

        x, y, z, direction = self._shelf_place(plan)
        ahead = np.array([np.cos(direction), np.sin(direction), 0.0])
        # Its fingers close along x, to the side that is nearer to how the hand was held.
        side = np.array([-ahead[1], ahead[0], 0.0])
        side *= np.copysign(1.0, side @ quaternion_to_rotation(plan.goal_pose[3:])[:, 0])
        rotation = np.column_stack([side, np.cross(ahead, side), ahead])
        position = np.array([x, y, z]) - self.approach.back_m * ahead
        return square_approach(plan, robot, position, rotation, self.approach.straight_m)

    def scene(self, plan: AnyPlan, robot: Robot) -> Hashable:
        """Return where the shelf stands."""
        return self._shelf_place(plan)

    def _shelf_place(self, plan: AnyPlan) -> tuple[float, float, float, float]:
        """Return the middle of a box at its place (m) and which way is ahead there (rad)."""
        w, x, y, z = plan.goal_pose[3:]
        ahead = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x)])
        place = plan.goal_pose[:3] if self.box.place_m is None else self.box.place_m
        return (float(place[0]), float(place[1]), float(place[2]), float(np.arctan2(*ahead[::-1])))

    def _box_poses(self, plan: AnyPlan) -> FloatArray:
        """Return where the box is tried: positions (m) and quaternions wxyz, shape (K, 7)."""
        x, y, z, ahead = self._shelf_place(plan)
        cos, sin = np.cos(ahead), np.sin(ahead)
        shifts = self.box.shift_m + self.box.spread_m * _SPREAD
        if self.box.spread_m == 0:
            shifts = shifts[:1]
        turned = (ahead + np.radians(self.box.turn_deg)) / 2
        poses = np.zeros((len(shifts), 7))
        poses[:, :2] = [x, y] + shifts @ [[cos, sin], [-sin, cos]]
        poses[:, 2:] = [z, np.cos(turned), 0.0, 0.0, np.sin(turned)]
        return poses

    def miss(self, plan: AnyPlan, outcome: FloatArray) -> float:
        """Return how much lower than wanted the box is, metres."""
        return float(np.maximum(self.target(plan)[2] - outcome[2], 0.0))

    def succeeds(self, miss: float, measures: dict[str, float], share: float = 1.0) -> bool:
        """Tell whether height and tilt of the box are within a share of what is permitted."""
        tilt = share * np.radians(self.success.success_tilt_deg)
        return super().succeeds(miss, measures, share) and bool(measures["tilt_rad"] <= tilt)

    def move(self, plans: Sequence[AnyPlan], robot: Robot | None) -> Movements:
        """Roll out the approaches, and lift after each."""
        from besman.simulation.tasks.grasp_box.grasping import add_lifts

        assert robot is not None
        approach = super().move(plans, robot)
        return add_lifts(robot, self, approach)

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Approach, close, lift; the paths are those of the box at its place."""
        from besman.simulation.tasks.grasp_box.grasp_scene import grasp_model
        from besman.simulation.tasks.grasp_box.grasping import simulate_grasps, summarize_poses

        model = grasp_model(robot, self, self._shelf_place(plans[0]))
        boxes = self._box_poses(plans[0])
        episodes = simulate_grasps(robot, self, model, boxes, movements, paths)
        return summarize_poses(episodes, len(boxes))
