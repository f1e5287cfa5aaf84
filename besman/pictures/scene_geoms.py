"""What stands in a task's scene beside the arm, and how it is coloured."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_TOOL, _FIXED, _THING = [0.25, 0.28, 0.33, 1.0], [0.62, 0.50, 0.38, 1.0], [0.84, 0.37, 0.0, 1.0]


@dataclass(frozen=True, eq=False)
class SceneGeoms:
    """Geoms of a scene that are not the arm's own.

    Attributes
    ----------
    ids : tuple of int
        Of the geoms in the scene's model.
    colours : array, shape (G, 4)
        Red, green, blue, opacity of each.
    moving : tuple of bool
        Whether each belongs to what is thrown, carried or pulled.
    """

    ids: tuple[int, ...]
    colours: FloatArray
    moving: tuple[bool, ...]


def seen_geoms(model: mujoco.MjModel) -> npt.NDArray[np.bool_]:
    """Tell which geoms of a scene (G,) are there to be seen."""
    return np.asarray(model.geom_rgba[:, 3] > 0)


def scene_geoms(robot: Robot, model: mujoco.MjModel) -> SceneGeoms:
    """Find what a scene holds beside the arm.

    Parameters
    ----------
    robot : Robot
        The arm.
    model : mujoco.MjModel
        The scene, made with `besman.robot.mujoco_model.arm_spec`.

    Returns
    -------
    SceneGeoms
        Tool, fixed things and what moves by itself. The capsules of the links are left out, and
        what is not seen.
    """
    links = robot.chain.capsule_links
    left = {"world": 0} | dict.fromkeys(robot.joint_names, 0)
    for link, joint in zip(links, robot.chain.capsule_joints, strict=True):
        if link != "tool":
            left["world" if joint < 0 else robot.joint_names[joint]] += 1
    root = model.body_rootid[model.body(robot.joint_names[0]).id]
    ids, colours, moving = [], [], []
    seen = seen_geoms(model)
    for geom in range(model.ngeom):
        if not seen[geom]:
            continue
        body = model.geom_bodyid[geom]
        name = model.body(body).name
        # Those of the links come first in their body.
        if left.get(name, 0) > 0:
            left[name] -= 1
            continue
        of_arm, moves = model.body_rootid[body] == root, bool(model.body_dofnum[body])
        ids.append(geom)
        moving.append(moves and not of_arm)
        colours.append(_TOOL if of_arm else _THING if moves else _FIXED)
    return SceneGeoms(tuple(ids), np.array(colours).reshape(-1, 4), tuple(moving))


def farthest_path(model: mujoco.MjModel, states: FloatArray, geoms: SceneGeoms) -> FloatArray:
    """Return the path of the centre of mass of what moves farthest of all that moves by itself.

    Parameters
    ----------
    model : mujoco.MjModel
        The scene.
    states : array, shape (F, nq)
        Positions of its joints.
    geoms : SceneGeoms
        Of the scene.

    Returns
    -------
    array, shape (F, 3)
        Metres; (0, 3) if nothing moves by itself.
    """
    bodies = sorted(
        {
            int(model.geom_bodyid[geom])
            for geom, moves in zip(geoms.ids, geoms.moving, strict=True)
            if moves
        }
    )
    if not bodies:
        return np.empty((0, 3))
    data = mujoco.MjData(model)
    places = np.empty((len(states), len(bodies), 3))
    for row, state in enumerate(states):
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        places[row] = data.xipos[bodies]
    farthest = int(np.linalg.norm(places - places[0], axis=2).max(axis=0).argmax())
    return places[:, farthest]
