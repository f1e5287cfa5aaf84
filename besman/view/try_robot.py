"""From an arm, or the file that describes one, to a page that shows what it can do."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import BesmanError, RobotError
from besman.io.atomic_files import check_folder, make_folder
from besman.pipeline.arm_trial import SHORT_M, ArmTrial, try_arm
from besman.robot.description_faults import check_robot
from besman.robot.model import Robot, find_robot, load_robot
from besman.robot.new_robot import DESCRIPTIONS, Wishes, add_robot
from besman.robot.workspace import Workspace, sample_workspace
from besman.view.arm_page import TriedArm, write_arm_page
from besman.work.display import Display, no_display


@dataclass(frozen=True)
class TriedRobot:
    """What came of it.

    Attributes
    ----------
    page : Path
        HTML, by itself.
    robot : Path
        The robot.yaml.
    said : list of str
        What the arm can do, in sentences.
    """

    page: Path
    robot: Path
    said: list[str]


def try_robot(
    what: str,
    wishes: Wishes,
    tool: str = "stick_holder",
    out: Path | None = None,
    *,
    jobs: int = 1,
    show: Display = no_display,
    say: Callable[[str], None] = lambda line: None,
) -> TriedRobot:
    """Bring an arm in, if need be, take the embedded throws through all stages, write a page.

    Parameters
    ----------
    what : str
        Name of a robot, path of a robot.yaml, or of a description (URDF, xacro, MJCF).
    wishes : Wishes
        Of a description; its folder is not looked at.
    tool : str
        What the arm carries; the task asks for a stick holder.
    out : Path, optional
        Folder of page, run and robot.yaml; without it ``runs/try_NAME``.
    jobs : int
        Threads or processes.
    show : Display, optional
        Shows how far it is.
    say : callable, optional
        Is told what is known before the work is done.

    Raises
    ------
    BesmanError
        If the arm cannot be loaded, or the folder not be used. What the arm cannot do is said on
        the page.
    """
    start = time.perf_counter()
    file = Path(what)
    is_description = file.suffix.lower() in DESCRIPTIONS
    folder = out or Path("runs") / f"try_{file.stem if len(file.suffix) else file.name}"
    check_folder(folder, f"{folder}", RobotError)
    path = _bring(file, wishes, folder, show) if is_description else find_robot(what)
    robot = load_robot(what if not is_description else path, tool)
    _, end = show("workspace")
    space = sample_workspace(robot)
    end(True)
    say(early_word(robot, space))
    make_folder(folder, kind=RobotError)
    trial = try_arm(robot, space.reach_m, folder / "run", jobs, show)
    replay = _write_replay(trial, folder / "run" / "replay.html", show)
    _, end = show("page")
    tried = TriedArm(robot, space, check_robot(path), trial, replay, time.perf_counter() - start)
    page = folder / f"{robot.name}.html"
    said = write_arm_page(tried, page)
    end(True)
    return TriedRobot(page, path, said)


def _bring(file: Path, wishes: Wishes, folder: Path, show: Display) -> Path:
    """Write a robot.yaml for a description; one that was written before is taken as it is."""
    there = sorted(folder.glob("*.yaml"))
    if len(there) == 1:
        return there[0]
    if there:
        names = ", ".join(one.name for one in there)
        raise RobotError(f"{folder}: holds {names}; expected one robot.yaml, or another --out")
    return add_robot(
        file,
        wishes.tip,
        wishes.name,
        folder,
        packages=wishes.packages,
        velocity=wishes.velocity,
        torque=wishes.torque,
        arguments=wishes.arguments,
        base=wishes.base,
        show=show,
    )


def _write_replay(trial: ArmTrial, file: Path, show: Display) -> Path | None:
    """Write the replay of a run that has something to show."""
    from besman.view.export import write_replay
    from besman.view.run_content import RunContent

    try:
        content = RunContent(trial.folder)
    except BesmanError:
        # What was wrong is in the trial, and on the page.
        return None
    progress, end = show("replay")
    motion = content.names[content.first]
    write_replay(content, file, motion, progress=progress)
    end(True)
    return file


def early_word(robot: Robot, space: Workspace) -> str:
    """Say before the work how long an arm is, and what follows from it."""
    word = f"{robot.name}: {robot.n} joints, reach {space.reach_m:.2f} m with {robot.tool.name}"
    if space.reach_m >= SHORT_M:
        return word
    return f"{word}, less than a person's arm ({SHORT_M:g} m): movements are made smaller"
