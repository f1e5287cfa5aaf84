"""The kinds of tasks there are, and their files."""

from __future__ import annotations

from pathlib import Path

from besman.config.resources import find_resource
from besman.config.yaml_file import parse_config, read_yaml
from besman.exceptions import ConfigError, nearest
from besman.simulation.task import Task
from besman.simulation.tasks.ball_throw.ball_throw import BallThrowConfig
from besman.simulation.tasks.grasp_box.grasp_box import GraspBoxConfig
from besman.simulation.tasks.pull_lever.pull_lever import PullLeverConfig
from besman.simulation.tasks.reach.reach import ReachConfig
from besman.simulation.tasks.stick_throw.stick_throw import StickThrowConfig

__all__ = [
    "BallThrowConfig",
    "GraspBoxConfig",
    "PullLeverConfig",
    "ReachConfig",
    "StickThrowConfig",
    "TaskConfig",
    "load_task",
]

TaskConfig = Task

_KINDS: dict[str, type[Task]] = {
    "ball_throw": BallThrowConfig,
    "grasp_box": GraspBoxConfig,
    "pull_lever": PullLeverConfig,
    "reach": ReachConfig,
    "stick_throw": StickThrowConfig,
}


def load_task(name_or_path: str) -> Task:
    """Load a task.

    Parameters
    ----------
    name_or_path : str
        Path to a task file, or the name of one in ``configs/tasks``.

    Returns
    -------
    Task
        Of the class that belongs to the file's ``kind``.

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
