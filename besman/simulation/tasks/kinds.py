"""The kinds of tasks there are, and their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from besman.config.resources import find_resource, resource_folder
from besman.config.yaml_file import KeyPath, parse_config, read_yaml
from besman.exceptions import ConfigError, nearest

if TYPE_CHECKING:
    from besman.simulation.task import Task
    from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig


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
"""All kinds of tasks of single movements there are."""

WHOLE_KINDS = (
    TaskKind(
        "rearrange",
        "rearrange.rearrange:RearrangeConfig",
        "boxes, a board below each of their places, three fingers (`gripper3`)",
        "the ways to and from boxes",
        "every box's place, turn and tilt; where the person put it",
    ),
)
"""All kinds of whole tasks, of `besman.records.TaskPlan`, there are."""


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
    path, content, lines, kind = _read_kind(name_or_path)
    kinds = {one.name: one for one in KINDS}
    if kind not in kinds:
        raise ConfigError(
            f"{path}:{lines[('kind',)]}: kind: {kind!r} is one of whole tasks (select: {{as: "
            f"blocks}}); expected one of single movements: {', '.join(kinds)}"
        )
    return parse_config(content, kinds[kind].load(), path, lines)


def is_whole_task(name_or_path: str) -> bool:
    """Tell whether a task is of whole actions; errors as of `load_task`."""
    kind = _read_kind(name_or_path)[3]
    return kind in {one.name for one in WHOLE_KINDS}


def load_whole_task(name_or_path: str) -> RearrangeConfig:
    """Load a task of whole actions, for which `is_whole_task` holds.

    Raises
    ------
    ConfigError
        If there is no such file, or it is not a valid task.
    """
    path, content, lines, kind = _read_kind(name_or_path)
    (entry,) = (one for one in WHOLE_KINDS if one.name == kind)
    config: type[RearrangeConfig] = entry.load()  # type: ignore[assignment]
    return parse_config(content, config, path, lines)


def _read_kind(name_or_path: str) -> tuple[Path, dict[str, Any], dict[KeyPath, int], str]:
    """Read a task's file; return its path, content, lines, and kind, which is one of all."""
    path: Path = find_resource("configs/tasks", name_or_path)
    content, lines = read_yaml(path)
    names, kind = [one.name for one in (*KINDS, *WHOLE_KINDS)], content.get("kind")
    if not isinstance(kind, str) or kind not in names:
        where = f"{path}:{lines[('kind',)]}" if "kind" in content else f"{path}"
        raise ConfigError(f"{where}: kind: got {kind!r:.60}; {nearest(str(kind), names)}")
    return path, content, lines, kind
