"""A box that a task plan takes, carries and puts down (synthetic), and what can go wrong."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import carry_box

from besman.exceptions import ConfigError, PlanError, RefinementError
from besman.motion.adapt_task import frame_matrix
from besman.motion.grasp_goals import aim_grasps
from besman.records.files import load_record, save_record
from besman.records.task_trial import RefinedTask
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import WHOLE_KINDS, is_whole_task, load_task, load_whole_task
from besman.simulation.tasks.rearrange import rearrange, rearranging
from besman.simulation.tasks.rearrange.arm_way import ArmWay
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses, frame_of_grasps
from besman.simulation.tasks.rearrange.clearance import Surroundings
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.rearrange_scene import rearrange_model
from besman.simulation.tasks.rearrange.rearranging import judge, simulate_task
from besman.simulation.tasks.rearrange.sections import GraspConfig, WaysConfig
from besman.simulation.tasks.rearrange.ways import Led, list_aimed
from besman.stages.refine.one_task import is_same
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.refine.whole_tasks import AimTasks, RefineTasks, SimulateTasks

TASK = load_whole_task("rearrange")


@functools.cache
def aimed_plan():
    robot, _, plan = carry_box()
    frame = TASK.box_frame([plan], robot)
    return robot, plan, frame, aim_grasps(plan, robot, TASK.grasp_way(frame))


def attempt(plan, task=TASK):
    robot, _, frame, _ = aimed_plan()
    (trial,) = task.try_tasks([plan], robot, frame)
    return trial


def changed(**sections):
    """The task with other values in its sections."""
    return TASK.model_copy(
        update={name: getattr(TASK, name).model_copy(update=to) for name, to in sections.items()}
    )


def test_the_box_stands_where_the_person_put_it_and_nothing_but_contact_moved_it():
    _, plan, frame, aimed = aimed_plan()
    trial = attempt(aimed)
    assert (trial.success, trial.failure) == (True, "")
    assert trial.miss < 0.01
    np.testing.assert_allclose(trial.wanted, box_poses(plan.target_poses, frame))
    np.testing.assert_allclose(
        trial.miss, np.linalg.norm(trial.outcomes[0, :3] - trial.wanted[0, :3])
    )
    lifted = frame_matrix(box_poses(plan.object_poses, frame)[0])[:3, 3] - trial.outcomes[0, :3]
    assert np.linalg.norm(lifted) > 0.1


def test_what_came_of_it_is_stored_and_comes_back(tmp_path):
    aimed = aimed_plan()[3]
    trial = attempt(aimed)
    save_record((RefinedTask(aimed, trial, 3),), tmp_path / "a.npz")
    (again,) = load_record(tmp_path / "a.npz")
    assert (again.tries, again.trial.name, again.trial.success) == (3, trial.name, True)
    np.testing.assert_array_equal(again.trial.outcomes, trial.outcomes)
    assert again.trial.angle == trial.angle


def test_threads_and_company_change_nothing():
    robot, _, frame, aimed = aimed_plan()
    alone = attempt(aimed)
    for one in TASK.try_tasks([aimed, aimed], robot, frame, 2):
        np.testing.assert_array_equal(one.outcomes, alone.outcomes)


@pytest.mark.parametrize(
    ("shift_m", "turn_deg", "stands"),
    [(0.0, 0.0, True), (0.015, 5.0, True), (0.025, 0.0, False), (0.0, 12.0, False)],
)
def test_beside_its_place_is_a_miss_and_no_failure(shift_m, turn_deg, stands):
    """The same simulation, held against another place."""
    robot, _, frame, aimed = aimed_plan()
    after = box_poses(aimed.target_poses, frame)
    way = TASK.way(aimed)
    _, run = simulate_task(robot, TASK, way, box_poses(aimed.object_poses, frame), after)
    wanted = np.array(after)
    wanted[0, 1] += shift_m
    half = np.arctan2(after[0, 6], after[0, 3]) + np.radians(turn_deg) / 2
    wanted[0, 3:] = [np.cos(half), 0, 0, np.sin(half)]
    trial = judge(run, TASK, aimed, way, wanted, robot)
    assert (trial.success, trial.failure) == (stands, "")
    assert trial.miss == pytest.approx(shift_m, abs=0.003)
    assert np.degrees(trial.angle) == pytest.approx(turn_deg, abs=1.5)


@pytest.mark.parametrize(
    ("task", "expected"),
    [
        (changed(gripper={"friction": 0.0}), "box dropped"),
        (changed(gripper={"opening_m": 0.2, "speed_m_s": 0.01}), "box not gripped"),
        (changed(failure={"greatest_tracking_error_rad": 1e-5}), "arm did not follow"),
        (changed(board={"front_m": 0.9, "depth_m": 2.0, "width_m": 2.0}), "collision with a board"),
    ],
    ids=["slippery", "too slow", "follow", "board"],
)
def test_what_goes_wrong_is_named(task, expected):
    trial = attempt(aimed_plan()[3], task)
    assert trial.failure.startswith(expected)
    assert not trial.success


def test_a_box_that_is_let_go_in_the_air_is_dropped_and_one_never_let_go_is_said():
    aimed = aimed_plan()[3]
    early = np.array([aimed.events_s[0], aimed.events_s[1] - 1.5])
    trial = attempt(dataclasses.replace(aimed, events_s=early))
    assert trial.failure.startswith("box dropped: let go ")
    # It lies where it fell to, however long it has been falling.
    assert trial.misses[0] < 2.0
    kept = dataclasses.replace(aimed, events_s=aimed.events_s[:1], events=("close",))
    assert attempt(kept).failure == "box not let go"


def test_boxes_that_fall_end_at_the_floor():
    high = np.array([0.2, 0.1, -0.1, -5.0])
    boxes = np.zeros((4, 2, 7))
    boxes[:, 0, 2], boxes[:, 1, 2] = high, 1.0
    boxes[:, :, 0] = np.arange(4)[:, None]
    found = rearranging.to_the_floor(boxes)
    np.testing.assert_array_equal(found[:, 0, 2], [0.2, 0.1, -0.1, -0.1])
    np.testing.assert_array_equal(found[:, 0, 0], [0, 1, 2, 2])
    np.testing.assert_array_equal(found[:, 1], boxes[:, 1])


def test_the_frame_of_a_box_is_told_from_where_it_is_taken():
    """Aimed tasks take it exactly there; one bad grasp of five does not matter."""
    robot, _, frame, aimed = aimed_plan()
    found = frame_of_grasps([aimed], robot)
    np.testing.assert_allclose(found.centre_m, frame.centre_m, atol=2e-3)
    assert found.turn_rad == pytest.approx(frame.turn_rad, abs=0.01)
    assert found.thumb == frame.thumb
    poses = np.array(aimed.object_poses)
    poses[0, :3] += 0.3
    bad = dataclasses.replace(aimed, object_poses=poses)
    again = frame_of_grasps([aimed, bad, aimed, aimed, bad], robot)
    np.testing.assert_allclose(again.centre_m, found.centre_m, atol=1e-9)
    none = dataclasses.replace(aimed, events_s=np.empty(0), events=())
    assert frame_of_grasps([none], robot) is None
    with pytest.raises(RefinementError, match="no task takes anything: expected a grasp, or box"):
        TASK.box_frame([none], robot)


def test_a_frame_that_is_given_is_taken():
    robot, plan, _, _ = aimed_plan()
    given = changed(box={"centre_m": (0.01, 0.02, -0.03), "turn_deg": 90.0})
    frame = given.box_frame([plan], robot)
    np.testing.assert_allclose(frame.centre_m, [0.01, 0.02, -0.03])
    np.testing.assert_allclose(frame.matrix[:3, 0], [0, 1, 0], atol=1e-12)
    pose = np.array([[1.0, 2.0, 3.0, 1, 0, 0, 0]])
    np.testing.assert_allclose(box_poses(pose, frame)[0, :3], [1.01, 2.02, 2.97])
    assert BoxFrame(np.zeros(3), 0.0).thumb == 1.0


def test_the_steps_count_what_is_out_of_reach_as_no_success():
    robot, plan, frame, aimed = aimed_plan()
    step = SimulateTasks(CmaEsConfig())
    (found,) = AimTasks(CmaEsConfig()).run((plan,), robot, TASK)
    np.testing.assert_array_equal(found.blocks[1].goal, aimed.blocks[1].goal)
    trials = step.run((found,), (plan,), robot, TASK)
    told = step.figures(trials, None, (found,), (plan, plan), robot, TASK)
    assert (told["n_tasks"], told["n_tried"], told["n_success"]) == (2, 1, 1)
    assert told["miss_m"]["max"] == trials[0].miss
    assert told["trials"][plan.name]["failure"] == ""
    assert frame.thumb in (-1.0, 1.0)


def test_other_ways_are_tried_until_one_succeeds(monkeypatch):
    """A gripper that hardly leaves the box takes it along; the first of the ways is good."""
    monkeypatch.setattr(rearrange, "lead_around", lambda *task: None)
    robot, plan, frame, aimed = aimed_plan()
    near = changed(grasp={"after_m": 0.005})
    shown = aim_grasps(plan, robot, near.grasp_way(frame))
    before = SimulateTasks(CmaEsConfig()).run((shown,), (plan,), robot, near)
    assert not before[0].success
    step = RefineTasks(CmaEsConfig())
    records = ((shown,), before, (plan,), robot, near)
    (found,) = step.run(*records)
    assert (found.trial.success, found.tries) == (True, 2)
    assert found.trial.miss == attempt(aimed).miss
    told = step.figures((found,), None, *records)
    assert (told["n_success"], told["tries"][plan.name]) == (1, 2)
    # What succeeded stays, and is not tried again.
    (same,) = step.run((found.plan,), (found.trial,), *records[2:])
    assert same.plan is found.plan
    assert same.tries == 1


def test_what_was_asked_for_and_touches_something_is_led_around_it():
    """A gripper that hardly leaves the box goes aside first."""
    robot, plan, frame, aimed = aimed_plan()
    near = changed(grasp={"after_m": 0.005})
    (found,) = AimTasks(CmaEsConfig()).run((plan,), robot, near)
    assert not is_same(found, aimed)
    around = Surroundings.of(plan, robot, near, frame)
    assert around.clearance(aim_grasps(plan, robot, near.grasp_way(frame))) < 0.0
    assert around.clearance(found) > 0.0
    (trial,) = SimulateTasks(CmaEsConfig()).run((found,), (plan,), robot, near)
    assert trial.success, trial.failure


def test_a_way_that_touches_nothing_comes_before_one_that_was_asked_for_and_does(monkeypatch):
    monkeypatch.setattr(rearrange, "lead_around", lambda *task: None)
    robot, plan, _, aimed = aimed_plan()
    near = changed(grasp={"after_m": 0.005})
    (found,) = AimTasks(CmaEsConfig()).run((plan,), robot, near)
    assert is_same(found, aimed)
    # Where all ways touch something, they come in the order of how much, not many of them.
    gaps = iter([-0.02, -0.01, -0.04, -0.03] + 20 * [-0.1])
    ways = list(list_aimed(range(24), lambda way: Led(plan, next(gaps)), robot))
    assert [way for way, _ in ways] == [1, 0, 3, 2, *range(4, 12)]


def test_what_no_way_reaches_is_said_with_the_first_reason():
    robot, plan, _, _ = aimed_plan()
    far = np.array(plan.object_poses)
    far[0, :3] += 3.0
    lost = dataclasses.replace(plan, object_poses=far)
    with pytest.raises(PlanError, match="out of reach of ur5 by"):
        RefineTasks(CmaEsConfig()).run((), (), (lost,), robot, TASK)


def test_what_does_not_belong_together_is_refused():
    plan = aimed_plan()[1]
    with pytest.raises(RefinementError, match="robot ur5 carries tool 'gripper', expected 'gripp"):
        TASK.check([plan], load_robot("ur5", "gripper"))
    with pytest.raises(RefinementError, match=r"plan for joints .*; robot iiwa7 has"):
        TASK.check([plan], load_robot("iiwa7", "gripper3"))
    assert [is_whole_task(entry.name) for entry in WHOLE_KINDS] == [True]
    assert not is_whole_task("reach")
    with pytest.raises(ConfigError, match=r"'rearrange' is one of whole tasks .*expected one of"):
        load_task("rearrange")


def test_the_fingers_close_and_open_at_their_speed_when_they_are_told():
    _, _, _, aimed = aimed_plan()
    way = TASK.way(aimed)
    assert isinstance(TASK, RearrangeConfig)
    assert isinstance(way, ArmWay)
    time = np.arange(0.0, way.movements.ends[0], 0.001)
    closed = way.finger_controls(TASK.gripper, time)[:, 0]
    speed = np.abs(np.diff(closed)) / 0.001
    assert speed.max() <= TASK.gripper.speed_m_s * 1.001
    told = [np.interp(at + 0.5, time, closed) for at in way.commands_s]
    half, way_m = TASK.gripper.opening_m / 2, 0.5 * TASK.gripper.speed_m_s
    np.testing.assert_allclose(told, [way_m, half - way_m], atol=1e-3)
    # The arm stands still meanwhile.
    for at, wait in zip(way.commands_s, (0.7, 0.8), strict=True):
        rows = slice(int((at + 0.01) / 0.004), int((at + wait - 0.01) / 0.004))
        assert not way.movements.velocities[0, rows].any()


def test_every_box_has_its_boards_and_sensors():
    robot = load_robot("ur5", "gripper3")
    poses = np.array([[0.5, 0, 0.3, 1, 0, 0, 0], [0.5, 0.4, 0.3, 1, 0, 0, 0]])
    model = rearrange_model(robot, TASK, poses, poses + np.eye(7)[1])
    assert model.nq == robot.n + 3 + 2 * 7
    assert model.nsensordata == 7 + 3 * 2 + 2 * 2
    board = model.geom("board_1_after")
    top = board.pos[2] + board.size[2]
    assert top == pytest.approx(0.3 - TASK.box.size_m[2] / 2)


def test_ways_are_all_combinations_but_the_one_that_is_shown():
    ways = WaysConfig(
        pitch_deg=(10.0, 0.0), after_m=(0.15,), higher_m=(0.1,), posture=(0,), before_m=(0.1, 0.2)
    )
    shown = GraspConfig(higher_m=0.1)
    found = [(one.pitch_deg, one.before_m) for one in ways.list(shown)]
    assert found == [(10.0, 0.2), (0.0, 0.1), (0.0, 0.2)]
    assert all((one.higher_m, one.up_m) == (0.1, shown.up_m) for one in ways.list(shown))


def test_a_board_stands_below_each_place_between():
    robot = load_robot("ur5", "gripper3")
    pose = np.array([[0.5, 0, 0.3, 1, 0, 0, 0]])
    model = rearrange_model(robot, TASK, pose, pose, pose + np.eye(7)[1])
    board = model.geom("board_between_0")
    assert board.pos[1] == pytest.approx(1.0)
    assert model.nsensordata == 7 + 3 + 2 + 1
