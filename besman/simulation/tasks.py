"""What a task file may say: scene, reward, success."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from besman.config_file import parse_config, read_yaml
from besman.exceptions import ConfigError, nearest
from besman.resources import find_resource
from besman.stage import Config

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class StickConfig(Config):
    """The stick: a rod with round ends and its mass spread evenly."""

    length_m: Annotated[float, Field(gt=0.05, le=2.0)] = 0.45
    radius_m: Annotated[float, Field(gt=0.001, le=0.02)] = 0.006
    mass_kg: Positive = 0.06


class HolderConfig(Config):
    """The holder: a square tube along TCP z, open in front; its back plate is at the TCP.

    Attributes
    ----------
    length_m : float
        From the back plate to the opening.
    clearance_m : float
        Between the stick's surface and each wall.
    friction : float
        Coefficient of sliding friction between stick and holder.
    """

    length_m: Positive = 0.15
    clearance_m: Positive = 0.002
    friction: NotNegative = 0.05


class ThrowSimulationConfig(Config):
    """How the throw is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    contact_time_s : float
        Time constant of a contact (MuJoCo's solref); stiff, or the landing point is wrong.
    clear_distance_m : float
        Distance of the stick's tail from the opening from which on the flight is ballistic.
    longest_wait_s : float
        How long after the movement the stick may still leave.
    """

    time_step_s: Annotated[float, Field(gt=0, le=0.005)] = 0.001
    contact_time_s: Positive = 0.002
    clear_distance_m: Positive = 0.15
    longest_wait_s: NotNegative = 0.3

    @model_validator(mode="after")
    def _contacts_are_resolved(self) -> Self:
        """Refuse contacts that the integrator cannot resolve."""
        if self.contact_time_s < 2 * self.time_step_s:
            raise ValueError(
                f"contact_time_s must be at least two time steps of {self.time_step_s:g} s"
            )
        return self


class ThrowRewardConfig(Config):
    """Reward of a throw: minus the sum of these terms.

    Attributes
    ----------
    miss_per_m : float
        Times the distance between touchdown and target.
    limit_excess_per_rad : float
        Times the sum over joints of how far positions go beyond their limits.
    collision_per_m : float
        Times the depth to which links enter each other or the pedestal.
    failure : float
        If the stick is dropped or not released, the arm does not follow, a limit is exceeded,
        the arm collides with itself, or the simulation is unstable.
    """

    miss_per_m: NotNegative = 1.0
    limit_excess_per_rad: NotNegative = 10.0
    collision_per_m: NotNegative = 50.0
    failure: NotNegative = 5.0


class FailureConfig(Config):
    """What counts as a failed episode.

    Attributes
    ----------
    least_release_speed_m_s : float
        A stick that leaves the holder slower than this was dropped, not thrown.
    greatest_tracking_error_rad : float
        Greatest deviation of any joint from the movement.
    """

    least_release_speed_m_s: NotNegative = 0.7
    greatest_tracking_error_rad: Positive = 0.05


class ThrowSuccessConfig(Config):
    """A throw succeeds if it lands within this distance of the target."""

    success_radius_m: Positive = 0.05


class StickThrowConfig(Config):
    """A stick is thrown at a target on the floor.

    Attributes
    ----------
    kind : "stick_throw"
    tool : str
        Tool of the robot that the holder is mounted on.
    motion_plan : "joint_dmp"
        The kind of motion plan that is refined.
    stick, holder, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["stick_throw"]
    tool: str = "stick_holder"
    motion_plan: Literal["joint_dmp"] = "joint_dmp"
    stick: StickConfig = StickConfig()
    holder: HolderConfig = HolderConfig()
    simulation: ThrowSimulationConfig = ThrowSimulationConfig()
    reward: ThrowRewardConfig = ThrowRewardConfig()
    failure: FailureConfig = FailureConfig()
    success: ThrowSuccessConfig = ThrowSuccessConfig()

    @property
    def success_radius_m(self) -> float:
        """Greatest distance between outcome and target, metres."""
        return self.success.success_radius_m

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.longest_wait_s


class ReachSimulationConfig(Config):
    """How the reaching movement is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    settling_s : float
        The end pose is taken this long after the end of the movement.
    """

    time_step_s: Annotated[float, Field(gt=0, le=0.005)] = 0.002
    settling_s: NotNegative = 0.1


class ReachRewardConfig(Config):
    """Reward of reaching: minus the sum of these terms.

    Attributes
    ----------
    miss_per_m, misorientation_per_rad : float
        Times the distance and the angle between reached and demonstrated end pose.
    limit_excess_per_rad, collision_per_m, failure
        As in `ThrowRewardConfig`.
    """

    miss_per_m: NotNegative = 1.0
    misorientation_per_rad: NotNegative = 0.1
    limit_excess_per_rad: NotNegative = 10.0
    collision_per_m: NotNegative = 50.0
    failure: NotNegative = 5.0


class ReachFailureConfig(Config):
    """What counts as a failed episode; see `FailureConfig`."""

    greatest_tracking_error_rad: Positive = 0.05


class ReachSuccessConfig(Config):
    """Reaching succeeds if the end pose is within both of these of the demonstrated one."""

    success_radius_m: Positive = 0.01
    success_angle_deg: Positive = 5.0


class ReachConfig(Config):
    """The tool is brought to the demonstrated end pose.

    Attributes
    ----------
    kind : "reach"
    tool : str
        Tool of the robot.
    motion_plan : "joint_dmp"
        The kind of motion plan that is refined.
    simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["reach"]
    tool: str = "gripper"
    motion_plan: Literal["joint_dmp"] = "joint_dmp"
    simulation: ReachSimulationConfig = ReachSimulationConfig()
    reward: ReachRewardConfig = ReachRewardConfig()
    failure: ReachFailureConfig = ReachFailureConfig()
    success: ReachSuccessConfig = ReachSuccessConfig()

    @property
    def success_radius_m(self) -> float:
        """Greatest distance between outcome and target, metres."""
        return self.success.success_radius_m

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.settling_s


TaskConfig = StickThrowConfig | ReachConfig

_KINDS: dict[str, type[StickThrowConfig] | type[ReachConfig]] = {
    "stick_throw": StickThrowConfig,
    "reach": ReachConfig,
}


def load_task(name_or_path: str) -> TaskConfig:
    """Load a task.

    Parameters
    ----------
    name_or_path : str
        Path to a task file, or the name of one in ``configs/tasks``.

    Returns
    -------
    TaskConfig
        The config that belongs to the file's ``kind``.

    Raises
    ------
    ConfigError
        If there is no such file, or it is not a valid task.
    """
    path: Path = find_resource("configs/tasks", name_or_path)
    content, lines = read_yaml(path)
    kind = content.get("kind")
    if kind not in _KINDS:
        where = f"{path}:{lines[('kind',)]}" if "kind" in content else f"{path}"
        raise ConfigError(f"{where}: kind: got {kind!r}; {nearest(str(kind), _KINDS)}")
    return parse_config(content, _KINDS[kind], path, lines)
