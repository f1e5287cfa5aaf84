"""The page of ``besman robots try``: an arm, its numbers, and what it made of the throws."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.yaml_file import load_config
from besman.exceptions import BesmanError
from besman.pipeline.arm_trial import SHORT_M, SMALLEST, ArmTrial
from besman.pipeline.stored_run import open_run
from besman.records import RefinedMotion
from besman.report.html_tables import html_table
from besman.report.page_style import STYLE
from besman.robot.config import RobotConfig
from besman.robot.description_faults import ODD_REACH, Doubt
from besman.robot.model import Robot, find_robot
from besman.robot.workspace import Workspace
from besman.stages.map.mapping import Mapping as MappedThrows
from besman.view.arm_figures import home_figure, workspace_figure
from besman.view.outcome_words import motion_words

_FRAME = (
    "iframe { width: 100%; height: 44rem; border: 1px solid var(--line); border-radius: .5rem }"
)
_LIMITS = ("position_deg", "velocity_deg_s", "acceleration_rad_s2", "torque_nm")


@dataclass(frozen=True, eq=False)
class TriedArm:
    """What the page is made of.

    Attributes
    ----------
    robot : Robot
        With its tool.
    space : Workspace
    doubts : sequence of Doubt
        What `besman.robot.description_faults.check_robot` found.
    trial : ArmTrial
    replay : Path, optional
        The replay of the run, one HTML file.
    seconds : float
        How long all took.
    """

    robot: Robot
    space: Workspace
    doubts: Sequence[Doubt]
    trial: ArmTrial
    replay: Path | None
    seconds: float


@dataclass(frozen=True, eq=False)
class _Outcome:
    """What of a run is told."""

    results: Mapping[str, Any]
    mapping: MappedThrows | None
    motion: RefinedMotion | None

    @property
    def mapped(self) -> tuple[int, int]:
        """How many throws were mapped, and how many there are."""
        found = self.results.get("map")
        if found is not None:
            return int(found["n_transferred"]), int(found["n_demonstrations"])
        return 0, int(self.results.get("select", {}).get("n_demonstrations", 0))

    @property
    def speed_share(self) -> float:
        """Share of the person's speed, of the throw in the middle."""
        return 1.0 / float(self.results["map"]["time_stretch"]["median"])


def write_arm_page(tried: TriedArm, page: Path) -> list[str]:
    """Write the page.

    Parameters
    ----------
    tried : TriedArm
    page : Path
        The file.

    Returns
    -------
    list of str
        What came of it, in sentences.
    """
    from besman.io.atomic_files import write_text

    outcome = _read_outcome(tried.trial)
    said = verdict(tried, outcome)
    robot = tried.robot
    title = html.escape(f"{robot.name} - besman")
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in said)
    body = [
        f"<h1>{html.escape(robot.name)} <span class=soft>{_kind(robot)}</span></h1>",
        _cards(tried, outcome),
        f"<ul>{lines}</ul>",
        "<h2>The arm at home</h2>",
        _figure(
            home_figure(robot, tried.space),
            "As it stands where nothing else is said; movements are looked for from here. Blue: "
            f"the tool {robot.tool.name}'s capsule.",
        ),
        "<h2>Joints</h2>",
        _joint_table(robot),
        _sources(robot),
        "<h2>Where its hand comes</h2>",
        _figure(workspace_figure(tried.space, robot), _workspace_words(tried.space)),
        "<h2>The throws</h2>",
        _throw_table(outcome),
        _replay(tried.replay),
        "<h2>What to look at in its description</h2>",
        _doubt_table(tried.doubts),
        _next_steps(tried),
    ]
    write_text(
        page,
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}{_FRAME}</style></head>\n<body>{''.join(body)}</body></html>\n",
    )
    return said


def _read_outcome(trial: ArmTrial) -> _Outcome:
    """Read what a run came to; of one that ended early what there is."""
    try:
        run = open_run(trial.folder)
        results = run.read("results.json")
    except BesmanError:
        return _Outcome({}, None, None)
    mapping = run.record("map") if "map" in results else None
    motions = run.record("refine") if "refine" in results else ()
    return _Outcome(results, mapping, motions[0] if motions else None)


def verdict(tried: TriedArm, outcome: _Outcome) -> list[str]:
    """Say in sentences what the arm can do of a person's throws."""
    space, robot = tried.space, tried.robot
    # A file of another size makes nonsense of all that follows.
    said = [one.text for one in tried.doubts if one.text.startswith(ODD_REACH)]
    if space.reach_m < SHORT_M:
        said.append(
            f"With {space.reach_m:.2f} m of reach, tool included, it is shorter than a person's "
            f"arm ({SHORT_M:g} m): movements were made smaller."
        )
    done, all_of_them = outcome.mapped
    if tried.trial.error:
        said.append(f"The run ended early: {tried.trial.error}")
    if not done or outcome.mapping is None:
        return said
    said.append(f"It can run {done} of {all_of_them} throws within all limits.")
    if outcome.mapping.scale < 0.995:
        said.append(f"They fit at {outcome.mapping.scale:.0%} of their size.")
    share = outcome.speed_share
    if share < 0.95:
        slow = _slowest_joint(robot, outcome.mapping)
        said.append(
            f"The throw in the middle runs at {share:.0%} of the person's speed: joint {slow} is "
            "at its limit most often. A thrown thing flies the less far."
        )
    motion = outcome.motion
    if motion is not None:
        end = "hits its target" if motion.success else "does not reach its target"
        n = len(motion.returns)
        said.append(
            f"{motion.plan.name}, refined for {n} episode{'s' if n != 1 else ''}, {end}: "
            f"{motion_words(motion)}."
        )
    return said


def _slowest_joint(robot: Robot, mapping: MappedThrows) -> str:
    """Return the joint that comes nearest to its limits of speed or acceleration on average."""
    used = np.zeros(robot.n)
    for one in mapping.trajectories:
        speed = np.abs(one.velocities).max(axis=0) / robot.limits.velocity
        force = np.abs(one.accelerations).max(axis=0) / robot.limits.acceleration
        used += np.maximum(speed, force)
    return robot.joint_names[int(np.argmax(used))]


def _kind(robot: Robot) -> str:
    return f"{robot.n} joints, tool {html.escape(robot.tool.name)}"


def _cards(tried: TriedArm, outcome: _Outcome) -> str:
    """Show the figures one looks for first."""
    done, all_of_them = outcome.mapped
    cards = [
        (f"{tried.space.reach_m:.2f} m", "reach, tool included"),
        (f"{done} / {all_of_them or 16}", "throws mapped"),
    ]
    if outcome.mapping is not None:
        cards.append((f"{outcome.mapping.scale:.0%}", "of their size"))
        cards.append((f"{min(outcome.speed_share, 1.0):.0%}", "of their speed (median)"))
        bad = outcome.mapping.limit_violations + outcome.mapping.self_collisions
        cards.append((str(bad), "samples outside a limit or touching"))
    if outcome.motion is not None and np.isfinite(outcome.motion.miss):
        cards.append((f"{100 * outcome.motion.miss:.1f} cm", "miss of the refined throw"))
    cards.append((f"{tried.seconds:.0f} s", "for all of this"))
    boxes = "".join(
        f'<div class="card"><b>{value}</b>{html.escape(name)}</div>' for value, name in cards
    )
    return f'<div class="cards">{boxes}</div>'


def _figure(drawing: str, words: str) -> str:
    caption = f"<figcaption>{html.escape(words)}</figcaption>"
    return f'<figure class="wide">{drawing}{caption}</figure>'


def _joint_table(robot: Robot) -> str:
    """List the joints: limits, home, and where each number comes from."""
    config = load_config(find_robot(robot.source), RobotConfig)
    usual = origins_of(robot)
    rows = []
    for joint in config.joints:
        low, high = joint.position_deg
        origin = {key: joint.origin.get(key, usual) for key in _LIMITS}
        rows.append(
            [
                html.escape(joint.name),
                _with_origin(f"{low:.0f} to {high:.0f}", origin["position_deg"]),
                _with_origin(f"{joint.velocity_deg_s:.0f}", origin["velocity_deg_s"]),
                _with_origin(f"{joint.acceleration_rad_s2:g}", origin["acceleration_rad_s2"]),
                _with_origin(f"{joint.torque_nm:g}", origin["torque_nm"]),
                f"{round(joint.home_deg) + 0}",
            ]
        )
    head = ["joint", "position [deg]", "speed [deg/s]", "acceleration [rad/s2]", "torque [Nm]",
            "home [deg]"]  # fmt: skip
    return html_table(head, rows)


def _sources(robot: Robot) -> str:
    """Fold the file in that says where the numbers come from."""
    file = find_robot(robot.source).with_name("SOURCES.md")
    if not file.is_file():
        return ""
    text = html.escape(file.read_text(encoding="utf-8", errors="replace"))
    return f"<details><summary>{file.name}</summary><pre>{text}</pre></details>"


def _with_origin(value: str, origin: str) -> str:
    """Write a number above where it comes from."""
    said = f'<br><span class="soft">{html.escape(origin)}</span>' if origin else ""
    return f"{html.escape(value)}{said}"


def origins_of(robot: Robot) -> str:
    """Say where numbers come from that bear no word of it."""
    sources = find_robot(robot.source).with_name("SOURCES.md")
    return sources.name if sources.is_file() else "not said"


def _workspace_words(space: Workspace) -> str:
    """Describe the figure in numbers."""
    clear = ~space.touching
    singular = float(space.singular[clear].mean()) if clear.any() else float("nan")
    return (
        f"Of {len(space.points)} random poses within the limits, {space.touching.mean():.0%} touch "
        f"something; of the others {singular:.0%} are singular or next to it: there is a direction "
        "in which the hand hardly moves."
    )


def _throw_table(outcome: _Outcome) -> str:
    """List the throws: how well each was mapped, or why not."""
    if outcome.mapping is None:
        return "<p>None was mapped.</p>"
    corrected = {one.name: one.shift_m for one in outcome.mapping.corrected}
    rows = []
    for one in outcome.mapping.trajectories:
        moved = corrected.get(one.name)
        rows.append(
            [
                html.escape(one.name),
                f"{1.0 / one.time_stretch:.0%}",
                f"{1000 * float(one.position_error.max()):.1f} mm",
                f"{np.degrees(float(one.orientation_error.max())):.1f} deg",
                "mapped" if moved is None else f"mapped, {100 * moved:.0f} cm beside the others",
            ]
        )
    rows += [
        [
            html.escape(one.name),
            "-",
            "-",
            "-",
            f'<span class="bad">{html.escape(one.reason)}</span>',
        ]
        for one in outcome.mapping.failed
    ]
    head = ["throw", "of its speed", "greatest error", "and turn", "what became of it"]
    return html_table(head, rows, words=True)


def _replay(replay: Path | None) -> str:
    """Put the replay into the page, as a document of its own."""
    if replay is None:
        return ""
    content = html.escape(replay.read_text(encoding="utf-8"))
    return (
        '<section class="screen"><h2>Person and arm, side by side</h2>'
        f'<iframe title="replay" sandbox="allow-scripts" srcdoc="{content}"></iframe></section>'
    )


def _doubt_table(doubts: Sequence[Doubt]) -> str:
    """List what is missing, doubtful or assumed."""
    if not doubts:
        return "<p>Nothing is missing, doubtful or assumed.</p>"
    rows = [
        [f'<span class="{"bad" if one.kind == "missing" else "soft"}">{one.kind}</span>',
         html.escape(one.text)]
        for one in doubts
    ]  # fmt: skip
    return html_table(["", "what"], rows, words=True)


def _next_steps(tried: TriedArm) -> str:
    """Say how to go on."""
    source, tool = html.escape(tried.robot.source), html.escape(tried.robot.tool.name)
    folder = html.escape(str(tried.trial.folder))
    scale = f" --set map.scale=[{SMALLEST:g},1]" if tried.trial.scaled else ""
    return (
        "<h2>How to go on</h2><pre>"
        f"besman run ur5_stick_throw --set robot={source} --tool {tool}{scale}\n"
        f"besman view {folder}\n"
        f"besman robots check {source}</pre>"
    )
