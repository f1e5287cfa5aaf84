"""An arm as triangles, looked at from a side."""

from collections import Counter

import numpy as np
import pytest

from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.workspace import sample_workspace
from besman.view import arm_drawing
from besman.view.arm_drawing import ArmSurface, arm_surface, capsule_mesh, project
from besman.view.arm_figures import home_figure, workspace_figure


@pytest.fixture(scope="module")
def robot():
    return load_robot("ur5", "stick_holder")


@pytest.mark.parametrize("ends", [[[0, 0, 0], [0.1, 0.2, 0.3]], [[0, 1, 0], [0, 3, 0]]])
def test_a_capsules_corners_are_on_it_and_its_triangles_look_outwards(ends):
    ends = np.array(ends, dtype=float)
    mesh = capsule_mesh(ends, 0.05)
    along = ends[1] - ends[0]
    share = np.clip((mesh.vertices - ends[0]) @ along / (along @ along), 0, 1)
    feet = ends[0] + share[:, None] * along
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - feet, axis=1), 0.05, atol=1e-12)
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    middle, normals = (a + b + c) / 3, np.cross(b - a, c - a)
    nearest = np.clip((middle - ends[0]) @ along / (along @ along), 0, 1)
    outwards = middle - (ends[0] + nearest[:, None] * along)
    real = np.linalg.norm(normals, axis=1) > 1e-12
    assert np.all(np.sum(normals * outwards, axis=1)[real] > 0)
    sides = Counter(
        tuple(edge) for t in mesh.triangles for edge in zip(t, np.roll(t, -1), strict=True)
    )
    assert max(sides.values()) == 1


def test_links_are_where_the_kinematics_say(robot):
    surface = arm_surface(robot, robot.home)
    corners = surface.triangles.reshape(-1, 3)
    tip = forward_kinematics(robot.chain, robot.home)[:3, 3]
    assert np.linalg.norm(corners - tip, axis=1).min() < 0.06
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert len(surface.colours) == len(surface.triangles) <= 8000


def test_what_is_nearer_is_drawn_later_and_has_its_place_in_the_picture():
    triangle = np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]])
    far = ArmSurface(np.stack([triangle + np.array([9.0, 0, 0]), triangle]), np.ones((2, 3)))
    corners, colours = project(far, np.array([1.0, 0, 0]))
    # Looking along x, y points to the left.
    np.testing.assert_allclose(corners[1], [[0, 0], [0, 1], [-1, 0]], atol=1e-12)
    assert np.all((colours > 0) & (colours <= 1))
    nearer_first, _ = project(far, np.array([-1.0, 0, 0]))
    np.testing.assert_allclose(nearer_first[:, 2, 0], [1, 1], atol=1e-12)


def test_the_figures_are_the_same_every_time(robot):
    space = sample_workspace(robot, 200)
    around = workspace_figure(space, robot)
    for drawing in (home_figure(robot, space), around):
        assert drawing.startswith("<svg")
        assert "forward [m]" in drawing or "height [m]" in drawing
    assert workspace_figure(space, robot) == around


def test_the_meshes_of_an_arm_are_read_once(robot, monkeypatch):
    arm_surface(robot, robot.home)
    monkeypatch.setattr(arm_drawing, "robot_meshes", None)
    moved = arm_surface(robot, robot.home + 0.1)
    assert moved.triangles.shape == arm_surface(robot, robot.home).triangles.shape
