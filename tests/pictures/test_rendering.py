"""Pictures against what they are of: skipped where this machine cannot draw without a screen."""

import sys

import mujoco
import numpy as np
import pytest

from besman.exceptions import RenderingError
from besman.pictures.camera import CameraView
from besman.pictures.rendering import Renderer
from besman.pictures.scene_geoms import scene_geoms
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task

NOWHERE = np.full(3, np.nan)


@pytest.fixture(scope="module")
def scene(make_plan):
    robot = load_robot("ur5", "stick_holder")
    played = load_task("stick_throw").play(robot, make_plan())
    data = mujoco.MjData(played.model)
    data.qpos[:] = played.states[0]
    mujoco.mj_forward(played.model, data)
    return robot, data, scene_geoms(robot, played.model)


@pytest.fixture(scope="module")
def renderer(scene):
    view = CameraView(np.array([0.0, 0.0, 0.6]), 3.0, 90.0, -20.0)
    try:
        with Renderer(scene[0], view, 160, 120) as one:
            yield one
    except RenderingError as error:
        pytest.skip(str(error))


def test_a_picture_shows_target_and_trail_where_they_are(scene, renderer):
    _, data, geoms = scene
    none = np.empty((0, 3))
    bare = renderer.draw(data, geoms, none, (NOWHERE, 0.1)).astype(int)
    assert bare.shape == (120, 160, 3)
    assert bare.std() > 5
    np.testing.assert_array_equal(bare, renderer.draw(data, geoms, none, (NOWHERE, 0.1)))
    changed = []
    # Seen along +y, x goes to the right: what is drawn there changes that half of the picture.
    for side in (-0.8, 0.8):
        place = np.array([side, 0.0, 0.9])
        seen = renderer.draw(data, geoms, none, (place, 0.2)).astype(int)
        columns = np.flatnonzero(np.abs(seen - bare).sum(axis=(0, 2)))
        changed.append(columns.mean())
    assert changed[0] < 75
    assert changed[1] > 85
    trail = np.column_stack([np.linspace(-0.8, 0.8, 20), np.zeros(20), np.full(20, 1.2)])
    drawn = renderer.draw(data, geoms, trail, (NOWHERE, 0.1)).astype(int)
    assert (np.abs(drawn - bare).sum(axis=(0, 2)) > 0).sum() > 60


def test_without_graphics_the_reason_is_said(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)
    view = CameraView(np.zeros(3), 3.0, 90.0, -20.0)
    with pytest.raises(RenderingError, match=r"cannot draw without a screen \(EGL: .*libegl1"):
        Renderer(scene[0], view, 16, 16)
