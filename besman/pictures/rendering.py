"""Pictures of an arm at its task, drawn without a screen."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Self

import mujoco
import numpy as np
import numpy.typing as npt

from besman.exceptions import RenderingError, in_one_line
from besman.pictures.arm_visuals import HIDDEN_GROUP, arm_visuals
from besman.pictures.camera import CameraView
from besman.pictures.scene_geoms import SceneGeoms
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

_TRAIL, _TARGET = [0.20, 0.52, 0.78, 1.0], [0.0, 0.55, 0.38, 0.9]
_TRAIL_M = 0.006
_MAX_GEOMS = 2000


class Renderer:
    """Draws pictures of one arm; a context manager, which lets go of the graphics at its end.

    Parameters
    ----------
    robot : Robot
        The arm.
    view : CameraView
        Where it is looked at from.
    width, height : int
        Of the pictures, pixels.

    Raises
    ------
    RenderingError
        If this machine cannot draw without a screen.
    """

    def __init__(self, robot: Robot, view: CameraView, width: int, height: int) -> None:
        self._context = _open_context(width, height)
        self._model = arm_visuals(robot, view, width, height)
        self._data = mujoco.MjData(self._model)
        self._n = robot.n
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:], self._camera.distance = view.centre, view.distance
        self._camera.azimuth, self._camera.elevation = view.azimuth, view.elevation
        try:
            self._graphics = mujoco.MjrContext(
                self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value
            )
        except mujoco.FatalError as error:
            self._context.free()
            raise _cannot(error) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._graphics)
        self._scene = mujoco.MjvScene(self._model, _MAX_GEOMS)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[HIDDEN_GROUP] = 0
        self._options.sitegroup[:] = 0
        self._rect = mujoco.MjrRect(0, 0, width, height)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._graphics.free()
        self._context.free()

    def draw(
        self,
        scene: mujoco.MjData,
        geoms: SceneGeoms,
        trail: FloatArray,
        target: tuple[FloatArray, float],
    ) -> Image:
        """Draw one moment.

        Parameters
        ----------
        scene : mujoco.MjData
            The task's scene with its kinematics computed.
        geoms : SceneGeoms
            What of it is drawn beside the arm.
        trail : array, shape (N, 3)
            Way so far of what moves, metres.
        target : pair of array, shape (3,), and float
            What is to be reached and how closely, metres.

        Returns
        -------
        uint8 array, shape (height, width, 3)
        """
        self._data.qpos[: self._n] = scene.qpos[: self._n]
        mujoco.mj_forward(self._model, self._data)
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, self._data, self._options, None, self._camera, everything, self._scene
        )
        for geom, colour in zip(geoms.ids, geoms.colours, strict=True):
            kind, size = scene.model.geom_type[geom], scene.model.geom_size[geom]
            self._add(kind, size, scene.geom_xpos[geom], scene.geom_xmat[geom], colour)
        self._add_trail(trail)
        self._add_target(*target)
        mujoco.mjr_render(self._rect, self._scene, self._graphics)
        image = np.empty((self._rect.height, self._rect.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, self._rect, self._graphics)
        return image[::-1]

    def _add(
        self, kind: int, size: Any, place: FloatArray, rotation: FloatArray, colour: Any
    ) -> None:
        """Add a geom to the picture."""
        geom = self._next_geom()
        if geom is None:
            return
        mujoco.mjv_initGeom(geom, int(kind), size, place, rotation, np.array(colour, np.float32))

    def _add_trail(self, trail: FloatArray) -> None:
        """Draw a path as a chain of thin capsules."""
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        for first, second in pairwise(trail):
            geom = self._next_geom()
            if geom is None:
                return
            mujoco.mjv_initGeom(
                geom,
                int(kind),
                np.zeros(3),
                np.zeros(3),
                np.eye(3).ravel(),
                np.array(_TRAIL, np.float32),
            )
            mujoco.mjv_connector(geom, int(kind), _TRAIL_M, first, second)
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR

    def _add_target(self, place: FloatArray, radius: float) -> None:
        """Draw a disc on the floor, or a small ball in the air."""
        if not np.isfinite(place).all():
            return
        turn = np.eye(3).ravel()
        if place[2] < 1e-6:
            disc = np.array([radius, 0.004, 0.0])
            self._add(mujoco.mjtGeom.mjGEOM_CYLINDER, disc, place, turn, _TARGET)
        else:
            ball = np.array([max(radius, 0.015), 0.0, 0.0])
            colour = [*_TARGET[:3], 0.45]
            self._add(mujoco.mjtGeom.mjGEOM_SPHERE, ball, place, turn, colour)

    def _next_geom(self) -> Any:
        """Return the next free geom of the picture, None if it is full."""
        if self._scene.ngeom >= self._scene.maxgeom:
            return None
        self._scene.ngeom += 1
        return self._scene.geoms[self._scene.ngeom - 1]


def _open_context(width: int, height: int) -> Any:
    """Open graphics without a screen."""
    try:
        from mujoco.egl import GLContext
        from OpenGL.error import Error as GraphicsError
    except (ImportError, AttributeError, OSError) as error:
        raise _cannot(error) from None
    try:
        context = GLContext(width, height)
        context.make_current()
    except (ImportError, AttributeError, RuntimeError, OSError, GraphicsError) as error:
        raise _cannot(error) from None
    return context


def _cannot(error: Exception) -> RenderingError:
    """Say that, and why, there are no pictures."""
    return RenderingError(
        f"video: this machine cannot draw without a screen (EGL: {in_one_line(error)}); expected "
        "the system's libegl1, libegl-mesa0 and libgl1-mesa-dri, or a graphics driver with EGL"
    )
