"""From an arm to its page."""

import dataclasses
import html
import re
import shutil

import numpy as np
import pytest

from besman.exceptions import FileError, MappingError, RobotError
from besman.pipeline import arm_trial
from besman.pipeline.arm_trial import ArmTrial, trial_recipe, try_arm
from besman.robot.description_faults import Doubt
from besman.robot.model import load_robot
from besman.robot.new_robot import Wishes
from besman.robot.workspace import sample_workspace
from besman.view import try_robot as tried_module
from besman.view.arm_page import TriedArm, write_arm_page
from besman.view.try_robot import try_robot

URDF = """<robot name="two"><link name="base"/><link name="upper"/><link name="hand"/>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<origin xyz="0 0 0.2"/><limit lower="-1.5" upper="1.5" effort="9" velocity="2"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="hand"/><axis xyz="0 1 0"/>
<origin xyz="0 0 0.25"/><limit lower="-1.5" upper="1.5" effort="9" velocity="2"/></joint>
</robot>"""


def text_of(page):
    return html.unescape(re.sub(r"<[^>]+>", " ", page.read_text()))


@pytest.fixture(scope="module")
def page(small_run, tmp_path_factory):
    """Write the page of a finished run."""
    robot = load_robot("ur5", "stick_holder")
    folder = tmp_path_factory.mktemp("page")
    trial = ArmTrial(small_run, trial_recipe(robot, False), False)
    replay = folder / "replay.html"
    replay.write_text('<!doctype html><script>"a" && 1</script>')
    space = sample_workspace(robot, 300)
    path = folder / "ur5.html"
    doubts = [Doubt("doubtful", "no capsules"), Doubt("doubtful", "reach: 4 m, 4 times")]
    said = write_arm_page(TriedArm(robot, space, doubts, trial, replay, 1.5), path)
    return path, said


def test_the_page_holds_joints_figures_throws_and_replay(page):
    path, said = page
    text, raw = text_of(path), path.read_text()
    robot = load_robot("ur5")
    for name, speed in zip(robot.joint_names, robot.limits.velocity, strict=True):
        assert re.search(rf"{name}.{{0,60}}{np.degrees(speed):.0f}\s+SOURCES.md", text, re.S)
    assert raw.count("<svg") == 2
    assert "Where the numbers of robot.yaml come from" in text
    # That the file is of another size comes before what it does.
    assert said[0] == "reach: 4 m, 4 times"
    assert "3 of 3 throws within all limits" in " ".join(said)
    assert all(line in text for line in said)
    assert re.findall(r'<a href|src="http|url\(http', raw) == []
    inside = re.search(r'srcdoc="([^"]*)"', raw)[1]
    assert html.unescape(inside) == '<!doctype html><script>"a" && 1</script>'


def test_the_page_shows_the_replay_in_a_browser(page, open_page):
    opened = open_page(page[0].as_uri())
    assert opened.locator("h1").inner_text().startswith("ur5")
    assert opened.locator("iframe").count() == 1
    assert opened.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_recipe_refines_one_motion_and_may_make_movements_smaller():
    robot = load_robot("ur5", "stick_holder")
    plain, scaled = trial_recipe(robot, False), trial_recipe(robot, True)
    assert plain.refine.motions == 1
    assert plain.refine.robustness is None
    assert (plain.map.scale, scaled.map.scale) == (None, (0.2, 1.0))
    assert (plain.robot, plain.tool) == ("ur5", "stick_holder")


@pytest.mark.parametrize(
    ("reach", "fails", "scales", "error"),
    [
        (0.9, {False}, [False, True], ""),
        (0.9, set(), [False], ""),
        (0.4, set(), [True], ""),
        (0.9, {False, True}, [False, True], "none fits"),
    ],
)
def test_what_does_not_fit_is_tried_smaller(monkeypatch, tmp_path, reach, fails, scales, error):
    asked = []

    def run(config, folder, **options):
        asked.append(config.map.scale is not None)
        if asked[-1] in fails:
            raise MappingError("none fits")

    monkeypatch.setattr(arm_trial, "run_pipeline", run)
    monkeypatch.setattr(arm_trial, "enough_mapped", lambda folder: True)
    trial = try_arm(load_robot("ur5", "stick_holder"), reach, tmp_path)
    assert asked == scales
    assert (trial.scaled, trial.error) == (scales[-1], error)


def test_half_of_the_throws_are_enough(small_run):
    assert arm_trial.enough_mapped(small_run)


def test_a_file_is_brought_in_once_and_an_arm_that_can_do_nothing_has_its_page(
    monkeypatch, tmp_path
):
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF)
    monkeypatch.setattr(
        tried_module,
        "try_arm",
        lambda robot, reach, folder, jobs, show: ArmTrial(folder, None, True, "none fits"),
    )
    said = []
    done = try_robot(str(urdf), Wishes(), out=tmp_path / "out", say=said.append)
    assert done.robot == tmp_path / "out" / "two.yaml"
    assert said[0].startswith("two: 2 joints, reach 0.")
    assert "less than a person's arm (0.6 m): movements are made smaller" in said[0]
    text = text_of(done.page)
    assert "The run ended early: none fits" in text
    # As it was tried, movements made smaller.
    assert "--set map.scale=[0.2,1]\n" in text
    assert "None was mapped." in text
    before = done.robot.read_bytes()
    assert try_robot(str(urdf), Wishes(), out=tmp_path / "out").robot.read_bytes() == before
    shutil.copy(done.robot, tmp_path / "out" / "other.yaml")
    with pytest.raises(RobotError, match=r"holds other.yaml, two.yaml; expected one robot.yaml"):
        try_robot(str(urdf), Wishes(), out=tmp_path / "out")


def test_a_folder_that_is_a_file_is_said_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises((RobotError, FileError), match="file"):
        try_robot("ur5", Wishes(), out=tmp_path / "file")


def test_sampled_poses_are_judged_as_one_by_one():
    robot = load_robot("ur5")
    space = sample_workspace(robot, 50, seed=3)
    again = sample_workspace(robot, 50, seed=3)
    np.testing.assert_array_equal(space.points, again.points)
    straight = np.array([0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.4, 0.0])
    from besman.robot.workspace import least_singular_values

    least = least_singular_values(robot, np.stack([straight, robot.home]), 1.0)
    assert least[0] < 1e-6 < 0.05 < least[1]
    assert dataclasses.is_dataclass(space)
    ways = np.linalg.norm(space.points - space.shoulder, axis=1)
    assert space.reach_m == ways[~space.touching].max()
