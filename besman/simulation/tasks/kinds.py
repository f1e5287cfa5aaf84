"""The kinds of tasks there are, and their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from besman.config.resources import find_resource, resource_folder
from besman.config.yaml_file import parse_config, read_yaml
from besman.exceptions import ConfigError, nearest

if TYPE_CHECKING:
    from besman.simulation.task import Task


@dataclass(frozen=True)
class TaskKind:
    """A kind of task: one entry of `KINDS`.

    Attributes
    ----------
    name : str
        The ``kind`` of its files; ``configs/tasks/NAME.yaml`` is its default.
    config : str
        Its subclass of `besman.simulation.task.Task`, ``module:Class`` below
        ``besman.simulation.tasks``; imported when a task of the kind is loaded.
    scene, refined, outcome : str
        What is simulated, what of it is the motion plan's, and what comes of it compared with
        what.
    """

    name: str
    config: str
    scene: str
    refined: str
    outcome: str

    @property
    def recipes(self) -> tuple[str, ...]:
        """Pipelines that come along with the task of this name."""
        paths = sorted(resource_folder("pipelines").glob("*.yaml"))
        return tuple(path.stem for path in paths if read_yaml(path)[0].get("task") == self.name)

    def load(self) -> type[Task]:
        """Return its class."""
        config: type[Task] = resolve_name(f"{__package__}.{self.config}")
        return config


KINDS = (
    TaskKind(
        "stick_throw",
        "stick_throw.stick_throw:StickThrowConfig",
        "a stick in a square tube (tool `stick_holder`)",
        "the throw",
        "touchdown; where the person's stick came down",
    ),
    TaskKind(
        "ball_throw",
        "ball_throw.ball_throw:BallThrowConfig",
        "a ball in a scoop (`scoop`)",
        "the throw",
        "touchdown; `target_m` ahead of the robot, or the person's",
    ),
    TaskKind(
        "grasp_box",
        "grasp_box.grasp_box:GraspBoxConfig",
        "a box on a shelf, three fingers (`gripper3`)",
        "the approach; closing and lift are the task's own",
        "the box's place at the end; lifted by `lift.height_m`",
    ),
    TaskKind(
        "pull_lever",
        "pull_lever.pull_lever:PullLeverConfig",
        "a lever on a hinge with dry friction (`hook`)",
        "the pull",
        "the handle's place at the end; pulled by `lever.pull_deg`",
    ),
    TaskKind(
        "reach",
        "reach.reach:ReachConfig",
        "the arm alone",
        "the movement",
        "end pose; the demonstrated one",
    ),
)
"""All kinds there are."""


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
    kinds, kind = {one.name: one for one in KINDS}, content.get("kind")
    if not isinstance(kind, str) or kind not in kinds:
        where = f"{path}:{lines[('kind',)]}" if "kind" in content else f"{path}"
        raise ConfigError(f"{where}: kind: got {kind!r:.60}; {nearest(str(kind), kinds)}")
    return parse_config(content, kinds[kind].load(), path, lines)
