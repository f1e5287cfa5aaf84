"""Several motions of a run as one movement that does not stop between them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from besman.exceptions import PlanError, RunError, nearest
from besman.io.atomic_files import folder_aside, write_json
from besman.motion.joint_move import join_movements
from besman.pipeline.finished_run import read_run
from besman.stages.export.motion_exports import RATE_HZ, is_export, write_movement


def join_motions(run: Path, names: Sequence[str], out: Path, blend_s: float) -> dict[str, Any]:
    """Write motions of a run, joined, in every format; beside them what they ask of the arm.

    Parameters
    ----------
    run : Path
        A finished run.
    names : sequence of str
        Of its motions, in their order; one may come several times.
    out : Path
        Folder, made if need be.
    blend_s : float
        See `besman.motion.joint_move.join_movements`.

    Returns
    -------
    dict
        Content of ``limits.json``: ``joined`` with its duration, limits and ``starts_s`` of the
        motions.

    Raises
    ------
    RunError
        If the folder is no finished run, or has no such motion.
    PlanError
        If there is no straight move from one motion to the next, or a motion is beyond a limit.
    """
    finished = read_run(run)
    motions = {motion.plan.name: motion for motion in finished.motions}
    for name in names:
        if name not in motions:
            raise RunError(f"{run}: no motion {name!r:.200}; {nearest(name, sorted(motions))}")
    chosen = [motions[name] for name in names]
    movement, starts = join_movements(
        finished.robot,
        [(one.time, one.positions, one.velocities, one.accelerations) for one in chosen],
        blend_s,
    )
    with folder_aside(out, keep=lambda name: not is_export(Path(name))) as folder:
        asked = write_movement(movement, finished.robot, folder, "joined")
        if not asked["exported"]:
            raise PlanError(f"{out}: not written: {asked['withheld']}")
        asked |= {"motions": list(names), "starts_s": list(starts)}
        content = {
            "robot": finished.robot.name,
            "tool": finished.robot.tool.name,
            "rate_hz": RATE_HZ,
            "joined": asked,
        }
        write_json(folder / "limits.json", content)
    return content
