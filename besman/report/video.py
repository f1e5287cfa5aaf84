"""A video of one motion of a run: imitated, on the way, and refined, side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from besman.config.yaml_file import read_yaml
from besman.exceptions import RenderingError, RunError, in_one_line, nearest, why_not_there
from besman.io.atomic_files import check_folder, make_folder, written_aside
from besman.pictures.camera import CameraView, frame_points
from besman.pictures.rendering import Renderer
from besman.pictures.scene_geoms import SceneGeoms, farthest_path, scene_geoms, seen_geoms
from besman.pipeline.derived_files import note_file
from besman.pipeline.stored_run import open_run
from besman.records import FloatArray, RefinedMotion
from besman.report.panels import BAND, Picture, join_panels, text_band
from besman.robot.model import Robot, load_robot
from besman.simulation.episodes import Playback
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans

_RATE_HZ = 25
_SPEED = 0.5
_HOLD_S = 1.2
_HEIGHT = 448
# Of one, two and three panels; multiples of 16, as the encoder likes them.
_WIDTHS = {1: 640, 2: 640, 3: 432}
_TRAIL_PARTS = 80
# How often the view looks at an episode, and what of a large thing must be in the picture.
_MOMENTS, _LARGEST_M = 40, 0.25


@dataclass(frozen=True, eq=False)
class Panel:
    """One episode of the video.

    Attributes
    ----------
    caption : str
    playback : Playback
    geoms : SceneGeoms
        Of its scene.
    trail : array, shape (F, 3)
        Path of what moves by itself, else of the tool centre point, metres.
    """

    caption: str
    playback: Playback
    geoms: SceneGeoms
    trail: FloatArray


def check_video() -> None:
    """Say beforehand if there can be no video.

    Raises
    ------
    RenderingError
        If the encoder is not installed, or nothing can be drawn without a screen.
    """
    _encoder()
    nothing = CameraView(np.zeros(3), 1.0, 0.0, 0.0)
    with Renderer(load_robot("ur5"), nothing, 16, 16):
        pass


def write_video(
    folder: Path,
    name: str | None = None,
    out: Path | None = None,
    *,
    second_arm: bool = False,
    progress: Callable[[float], None] = lambda done: None,
) -> Path:
    """Write the video of a motion: MP4 (H.264), 25 frames a second, at half speed.

    Parameters
    ----------
    folder : Path
        A run folder.
    name : str, optional
        Of the motion; without it one that succeeds, the first of those with most to show.
    out : Path, optional
        File to write; without it ``video.mp4`` in the run folder, of a named motion
        ``video_NAME.mp4``.
    second_arm : bool
        Of the run's second arm.
    progress : callable
        Told the share that is done.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunError
        If the folder is not a run with refined motions, or has no such motion.
    RenderingError
        If there can be no video on this machine, or the file cannot be written.
    """
    if out is not None and out.suffix != ".mp4":
        raise RenderingError(f"--out: got {out}, expected a name that ends in .mp4")
    if out is not None:
        check_folder(out.parent, f"{out}", RenderingError)
    config, motions = _load(folder, second_arm)
    motion = _choose(motions, name)
    if out is None:
        part = "" if name is None else "_" + motion.plan.name.replace("/", "_").replace(":", "_")
        out = folder / f"video{'_second' if second_arm else ''}{part}.mp4"
    _encoder()
    arm = config["second_arm"] if second_arm else config
    robot, task = load_robot(arm["robot"], arm["tool"]), load_task(config["task"])
    panels = [_panel(motion, index, robot, task) for index in range(len(_shown(motion)))]
    title = f"{robot.name}, {task.kind}: {motion.plan.name}"
    frames = _frames(panels, robot, task, motion, title, progress)
    _write(frames, _size(len(panels)), out)
    note_file(folder, out)
    return out


def _load(folder: Path, second_arm: bool) -> tuple[dict[str, Any], tuple[RefinedMotion, ...]]:
    """Read a run's config and its refined motions."""
    stage = "refine_second" if second_arm else "refine"
    if not (folder / "pipeline.yaml").is_file():
        raise RunError(f"{folder}: not a run: pipeline.yaml is missing")
    run = open_run(folder)
    if stage not in run.stages:
        raise RunError(f"{folder}: no refined motions ({stage}) to show; finish the run first")
    return read_yaml(folder / "pipeline.yaml")[0], run.record(stage)


def _choose(motions: tuple[RefinedMotion, ...], name: str | None) -> RefinedMotion:
    """Return the motion of a name, or the first that shows most."""
    if not motions:
        raise RunError("no motion was refined: there is nothing to show")
    if name is None:
        return max(motions, key=lambda motion: (motion.success, len(motion.milestones)))
    by_name = {motion.plan.name: motion for motion in motions}
    if name not in by_name:
        raise RunError(f"--motion: no motion {name!r}; {nearest(name, by_name)}")
    return by_name[name]


def _shown(motion: RefinedMotion) -> tuple[tuple[int, Any], ...]:
    """Return up to three episodes with their plans; of an older record the best alone."""
    found = motion.milestones or ((-1, motion.plan),)
    return tuple(found[row] for row in sorted({0, len(found) // 2, len(found) - 1}))


def _panel(motion: RefinedMotion, index: int, robot: Robot, task: Task) -> Panel:
    """Perform one of the episodes again."""
    episode, plan = _shown(motion)[index]
    playback = task.play(robot, plan)
    if not len(playback.states):
        raise RunError(f"{plan.name}: episode {episode}: the simulation diverged at its start")
    geoms = scene_geoms(robot, playback.model)
    trail = farthest_path(playback.model, playback.states, geoms)
    if not len(trail):
        trail = _tool_path(playback)
    return Panel(_caption(motion, index, robot, task), playback, geoms, trail)


def _caption(motion: RefinedMotion, index: int, robot: Robot, task: Task) -> str:
    """Say which episode it is and what came of it."""
    shown = _shown(motion)
    episode, plan = shown[index]
    last = "refined" if motion.success else "best found"
    what = "imitated" if episode == 0 else last if index == len(shown) - 1 else "on the way"
    miss = motion.misses[episode] if episode >= 0 else motion.miss
    if np.isfinite(miss):
        came = f"miss {100 * miss:.1f} cm"
    else:
        # What the search checked beyond the simulation are the limits at 1 kHz.
        came = f"failed: {try_plans(robot, task, [plan])[0].failure or 'limit exceeded'}"
    return f"{what} · {came}" if episode < 0 else f"{what} · episode {episode} · {came}"


def _tool_path(playback: Playback) -> FloatArray:
    """Return the way of the tool centre point, shape (F, 3), metres."""
    data = mujoco.MjData(playback.model)
    path = np.empty((len(playback.states), 3))
    for row, state in enumerate(playback.states):
        data.qpos[:] = state
        mujoco.mj_kinematics(playback.model, data)
        path[row] = data.site("tcp").xpos
    return path


def _view(panels: list[Panel], robot: Robot, target: FloatArray, aspect: float) -> CameraView:
    """Choose one view for all panels."""
    base = robot.chain.placements[0, :3, 3]
    foot = base * [1.0, 1.0, 0.0]
    points = [foot[None], *(_extent(panel) for panel in panels)]
    if np.isfinite(target).all():
        points.append(target[None])
    aim = target if np.isfinite(target).all() else panels[-1].trail[-1]
    heading = float(np.arctan2(*(aim - foot)[[1, 0]]))
    return frame_points(np.concatenate(points), heading, aspect)


def _extent(panel: Panel) -> FloatArray:
    """Return corners around everything that an episode shows, at some moments, shape (N, 3)."""
    model, data = panel.playback.model, mujoco.MjData(panel.playback.model)
    sides = np.array(list(product((-1.0, 1.0), repeat=3)))
    found, seen = [], seen_geoms(model)
    for row in np.linspace(0, len(panel.playback.states) - 1, _MOMENTS).astype(int):
        data.qpos[:] = panel.playback.states[row]
        mujoco.mj_kinematics(model, data)
        # Half the box that a geom fits into however it is turned.
        reach = np.minimum(model.geom_rbound, _LARGEST_M)[seen, None, None] / np.sqrt(3.0)
        found.append((data.geom_xpos[seen, None] + reach * sides).reshape(-1, 3))
    return np.concatenate([*found, panel.trail[::10], panel.trail[-1:]])


def _frames(
    panels: list[Panel],
    robot: Robot,
    task: Task,
    motion: RefinedMotion,
    title: str,
    progress: Callable[[float], None],
) -> Iterator[Picture]:
    """Draw all pictures of the video, one after the other."""
    width = _WIDTHS[len(panels)]
    target = np.asarray(task.target(motion.plan))
    view = _view(panels, robot, target, width / _HEIGHT)
    step = task.simulation.time_step_s
    times = np.arange(0, max(len(one.playback.states) for one in panels) * step, _SPEED / _RATE_HZ)
    captions = [text_band(width, panel.caption) for panel in panels]
    data = [mujoco.MjData(panel.playback.model) for panel in panels]
    picture: Picture = np.empty(0, dtype=np.uint8)
    with Renderer(robot, view, width, _HEIGHT) as renderer:
        for done, time in enumerate(times):
            drawn = []
            for panel, scene in zip(panels, data, strict=True):
                at = min(round(time / step), len(panel.playback.states) - 1)
                scene.qpos[:] = panel.playback.states[at]
                mujoco.mj_kinematics(panel.playback.model, scene)
                trail = panel.trail[: at + 1 : max(1, len(panel.trail) // _TRAIL_PARTS)]
                trail = np.concatenate([trail, panel.trail[at : at + 1]])
                goal = (target, task.success_radius_m)
                drawn.append(renderer.draw(scene, panel.geoms, trail, goal))
            line = f"{title}    half speed    {time:.2f} s"
            picture = join_panels(
                drawn, captions, text_band(width * len(panels), line, 14, soft=True)
            )
            progress((done + 1) / len(times))
            yield picture
    for _ in range(round(_HOLD_S * _RATE_HZ)):
        yield picture


def _size(n_panels: int) -> tuple[int, int]:
    """Return width and height of the video, pixels."""
    return _WIDTHS[n_panels] * n_panels, _HEIGHT + 2 * BAND


def _encoder() -> Any:
    """Return the module that encodes."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except ImportError as error:
        why = why_not_there(error, "imageio-ffmpeg", "besman[video]")
        raise RenderingError(f"video: {why}") from None
    except RuntimeError as error:
        raise RenderingError(f"video: no ffmpeg: {in_one_line(error)}") from None
    return imageio_ffmpeg


def _write(frames: Iterator[Picture], size: tuple[int, int], out: Path) -> None:
    """Encode pictures; a reader sees the whole file or none."""
    ffmpeg, n_frames = _encoder(), 0
    first = next(frames)
    make_folder(out.parent, kind=RenderingError)
    with written_aside(out, kind=RenderingError) as temporary:
        writer = ffmpeg.write_frames(
            str(temporary),
            size,
            fps=_RATE_HZ,
            codec="libx264",
            output_params=["-crf", "24", "-movflags", "+faststart"],
            ffmpeg_log_level="quiet",
        )
        writer.send(None)
        for frame in chain([first], frames):
            writer.send(np.ascontiguousarray(frame))
            n_frames += 1
        writer.close()
        # The library says nothing if ffmpeg finds no room for the last pictures.
        if _count_frames(ffmpeg, temporary) != n_frames:
            raise RenderingError(
                f"{out}: cannot be written: ffmpeg ended before the last picture (a full disk?)"
            )


def _count_frames(ffmpeg: Any, path: Path) -> int:
    """Return how many pictures a video holds; 0 if it cannot be read."""
    try:
        n_frames, _ = ffmpeg.count_frames_and_secs(str(path))
    except (OSError, RuntimeError):
        return 0
    return int(n_frames)
