import json
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from dart_throws import throw
from scipy.spatial.transform import Rotation

from besman.config.stage import Work
from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError, MappingError
from besman.records import Failure, HandTrajectory, LabelledSegments
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import load_robot
from besman.stages.map.demonstration import (
    MappingSettings,
    place_target,
    pose_errors,
    tool_poses,
    why_not,
)
from besman.stages.map.placement import PlacementSearch, find_placement
from besman.stages.map.placement_cost import ArmPaths, pose_of
from besman.stages.map.stage import MapConfig, map_results
from besman.stages.map.terms import TermWeights, path_terms
from besman.stages.select.stage import SelectConfig

ROBOT = load_robot("ur5", "stick_holder")
QUICK = MapConfig(free_axis_spin=True, evaluations=40)
# Where it does not matter how demonstrations are turned: an eighth of the placements.
AHEAD = QUICK.model_copy(update={"yaw": False})


@pytest.fixture(scope="module")
def mapping():
    return QUICK.run(tuple(throw(i) for i in range(3)), ROBOT, work=Work())


@pytest.fixture(scope="module")
def ahead():
    return AHEAD.run(tuple(throw(i) for i in range(3)), ROBOT, work=Work())


def test_throws_are_transferred_within_all_limits(mapping):
    results = json.loads(json.dumps(map_results(mapping)))
    assert results["n_transferred"] == results["n_demonstrations"] == 3
    assert results["limit_violations"] == results["self_collisions"] == 0
    assert results["position_error_m"]["max"] < 0.01
    assert results["orientation_error_deg"]["p95"] < 3
    assert 1.0 <= results["time_stretch"]["max"] < 1.6
    for one in mapping.trajectories:
        _, *dense = resample_trajectory(one.time, one.positions, one.velocities, one.accelerations)
        report = check_limits(ROBOT, *dense)
        assert report.violations == report.self_collisions == 0


def test_the_placement_turns_about_the_vertical_alone(mapping):
    np.testing.assert_allclose(mapping.placement[2, :3], [0, 0, 1])
    np.testing.assert_allclose(
        mapping.placement[:3, :3] @ mapping.placement[:3, :3].T, np.eye(3), atol=1e-12
    )
    for index, one in enumerate(mapping.trajectories):
        placed = mapping.placement @ tool_poses(throw(index), ROBOT)
        np.testing.assert_allclose(one.poses[:, :3], placed[:, :3, 3], atol=1e-12)
        target = mapping.placement @ np.r_[throw(index).target, 1]
        np.testing.assert_allclose(one.target, [*target[:2], 0.0], atol=1e-12)


def test_the_result_does_not_depend_on_the_number_of_threads(ahead):
    again = AHEAD.run(tuple(throw(i) for i in range(3)), ROBOT, work=Work(jobs=3))
    assert again.placement.tobytes() == ahead.placement.tobytes()
    for one, other in zip(again.trajectories, ahead.trajectories, strict=True):
        assert one.positions.tobytes() == other.positions.tobytes()


def test_what_cannot_be_reached_is_listed_with_its_reason():
    mapping = AHEAD.run((throw(0), throw(1), throw(2), throw(3, size=4.0)), ROBOT)
    assert len(mapping.trajectories) == 3
    assert len(mapping.failed) == 1
    assert mapping.failed[0].name == "a.tsv:3"
    assert mapping.failed[0].reason.startswith("position error ")
    assert "at most greatest_error_m 0.05" in mapping.failed[0].reason


def test_an_arm_too_weak_for_its_own_weight():
    weak = replace(ROBOT, limits=replace(ROBOT.limits, torque=0.05 * ROBOT.limits.torque))
    message = "the weight of arm and tool alone asks for more torque than a joint has "
    with pytest.raises(MappingError, match=message):
        AHEAD.run((throw(0),), weak)


def test_without_a_change_of_path_time_is_stretched_more():
    slow = replace(ROBOT, limits=replace(ROBOT.limits, velocity=0.7 * ROBOT.limits.velocity))
    throws = tuple(throw(i) for i in range(2))
    changed = AHEAD.run(throws, slow)
    plain = AHEAD.model_copy(update={"greatest_change_m": 0.0}).run(throws, slow)
    for one, other in zip(changed.trajectories, plain.trajectories, strict=True):
        assert one.time_stretch < other.time_stretch
        assert other.position_error.max() < 0.001
        assert one.position_error.max() < 0.0055


def test_a_throw_without_a_target_is_listed():
    blind = throw(1)
    blind = HandTrajectory(blind.time, blind.poses, blind.name, blind.label)
    mapping = AHEAD.run((throw(0), blind), ROBOT)
    assert mapping.failed == (
        Failure("a.tsv:1", "the flight of the thrown object was not seen, so there is no target"),
    )


def test_a_demonstration_ten_metres_long():
    message = r"ur5 \(tool stick_holder\) is too short for all of 1 demonstrations; a.tsv:0: "
    message += r"its tool's places are up to 10.06 m apart, the arm's at most 2.\d\d m"
    with pytest.raises(MappingError, match=message):
        AHEAD.run((throw(0, size=17.0),), ROBOT)


def test_a_demonstration_that_fits_by_its_size_alone():
    message = "none of 1 demonstrations can be transferred to ur5 .*: a.tsv:0: position error"
    exact = AHEAD.model_copy(update={"greatest_error_m": 1e-9})
    with pytest.raises(MappingError, match=message):
        exact.run((throw(0),), ROBOT)


def broken(poses=None, n_samples=51):
    good = throw(0)
    poses = np.array(good.poses if poses is None else poses)
    return HandTrajectory(good.time[:n_samples], poses[:n_samples], "b", "throw")


@pytest.mark.parametrize(
    ("demonstrations", "message"),
    [
        ((), "expected at least one demonstration"),
        ((broken(n_samples=1),), "b: expected a demonstration of at least three poses, got 1"),
        ((broken(np.full((51, 7), np.nan)),), "b: expected finite poses"),
        ((broken(np.zeros((51, 7))),), "b: got a quaternion of zero"),
    ],
)
def test_demonstrations_that_cannot_be_used(demonstrations, message):
    with pytest.raises(MappingError, match=message):
        QUICK.run(demonstrations, ROBOT)


def test_the_tool_follows_the_hand():
    poses = tool_poses(throw(0), ROBOT)
    hand = throw(0).poses[:, :3]
    # The stick's balance, 0.225 m along the tool, stays where the hand holds it.
    balance = poses[:, :3, 3] + 0.225 * poses[:, :3, 2]
    distance = np.linalg.norm(balance - hand, axis=1)
    np.testing.assert_allclose(distance, np.linalg.norm([0.045, 0.010, -0.045]), atol=1e-3)


def test_pose_errors():
    asked = np.tile(np.eye(4), (2, 1, 1))
    reached = asked.copy()
    reached[1, :3, 3] = [0.03, 0.04, 0]
    reached[0, :3, :3] = Rotation.from_euler("z", 0.3).as_matrix()
    reached[1, :3, :3] = Rotation.from_euler("x", 0.2).as_matrix()
    position, orientation = pose_errors(reached, asked)
    np.testing.assert_allclose(position, [0, 0.05], atol=1e-12)
    np.testing.assert_allclose(orientation, [0.3, 0.2], atol=1e-12)
    _, pointing = pose_errors(reached, asked, free_spin=True)
    np.testing.assert_allclose(pointing, [0, 0.2], atol=1e-12)


def test_placement_brings_the_centre_where_it_should():
    centre = np.array([0.2, -0.3, 0.4])
    pose = pose_of(np.array([0.5, 0.1, 1.2, 0.7]), centre)
    np.testing.assert_allclose(pose @ [*centre, 1], [0.5, 0.1, 1.2, 1])
    assert np.isnan(place_target(np.full(3, np.nan), pose)).all()


def test_terms_of_a_still_arm_at_home():
    positions = np.tile(ROBOT.home, (5, 1))
    targets = np.tile(np.eye(4), (5, 1, 1))
    targets[:, 0, 3] = np.linspace(0, 1, 5)
    errors = np.tile([0.02, np.radians(5)], (5, 1))
    terms = path_terms(ROBOT, positions, errors, targets, np.full((1, 1), 0.1))
    np.testing.assert_allclose(terms, [2.0, 0.5, 0.0, 0.0, 0.0, 1.0], atol=1e-9)
    moving = positions + np.outer([0, 1, 2, 3, 4], np.full(6, 0.2 * np.pi))
    speed = path_terms(ROBOT, moving, errors, targets, np.full((1, 1), 0.1))[4]
    assert speed == pytest.approx(1.0)


def test_the_height_counts_where_it_is_known():
    arm = [ArmPaths(ROBOT, [(throw(0).time, tool_poses(throw(0), ROBOT))])]
    options = {"free_spin": True, "evaluations": 60, "seed": 1, "yaw": False}
    strict = find_placement(
        arm, PlacementSearch(weights=TermWeights(height=50.0), **options), back_height=1.2
    )
    assert strict.pose[2, 3] == pytest.approx(1.2, abs=0.02)
    free = find_placement(arm, PlacementSearch(**options))
    assert free.terms["height"] == 0.0


def test_configs_refuse_what_makes_no_sense():
    for content, message in (
        ({"evaluations": 0}, "evaluations: got 0"),
        ({"weights": {"speeed": 1}}, "unknown key 'weights.speeed'; did you mean 'speed'"),
        ({"greatest_error_m": -1}, "greatest_error_m: got -1"),
    ):
        with pytest.raises(ConfigError, match=message):
            parse_config(content, MapConfig, "p.yaml")
    with pytest.raises(ConfigError, match="expected one of label and action, got none"):
        parse_config({}, SelectConfig, "p.yaml")


REAL = Path(
    os.environ.get("BESMAN_REAL_DATA", Path(__file__).parents[3].parent / "shared" / "data")
)


@pytest.mark.skipif(not (REAL / "pick_and_place").is_dir(), reason="real recordings are not there")
def test_real_reaching_movements_are_transferred():
    from scipy.interpolate import CubicSpline

    from besman.io.recordings.qtm_tsv import read_tsv
    from besman.io.segments_json import find_segments, read_segments
    from besman.records import LabelledRecording

    recordings, segments = [], []
    for path in sorted((REAL / "pick_and_place").glob("*.tsv"))[:4]:
        raw = read_tsv(path)
        positions = np.array(raw.positions)
        for marker in range(positions.shape[1]):
            seen = np.isfinite(positions[:, marker]).all(axis=1)
            spline = CubicSpline(raw.time[seen], positions[seen, marker])
            positions[:, marker] = spline(raw.time)
        names = tuple(str(name).lower().replace(" ", "_") for name in raw.names)
        recordings.append(
            LabelledRecording(
                raw.time, positions, names, np.zeros(positions.shape[:2], bool), raw.rate_hz,
                raw.source, raw.first_frame,
            )
        )  # fmt: skip
        segments.append(read_segments(find_segments(path), raw))
    hands = SelectConfig(label="approach_forward").run(tuple(recordings), tuple(segments))
    mapping = MapConfig(evaluations=40, yaw=False).run(
        hands, load_robot("ur5", "gripper"), Work(jobs=2)
    )
    results = map_results(mapping)
    assert results["n_transferred"] == len(hands) == 4
    assert results["position_error_m"]["p95"] < 0.005
    assert results["limit_violations"] == results["self_collisions"] == 0


def test_selected_demonstrations_are_named_by_recording_and_segment():
    from besman.records import LabelledRecording

    time = np.arange(100) / 100
    positions = np.random.default_rng(0).normal(0, 0.3, (1, 6, 3)) + np.zeros((100, 6, 3))
    names = ("back_top", "back_left", "back_right", "hand_top", "hand_left", "hand_right")
    recording = LabelledRecording(time, positions, names, np.zeros((100, 6)), 100.0, "b.tsv")
    segments = LabelledSegments([[0, 40], [40, 90]], ("idle", "reach"), [0, 0], 100.0, "b.tsv")
    (hand,) = SelectConfig(label="reach").run((recording,), (segments,))
    assert (hand.name, hand.label) == ("b.tsv:1", "reach")


@pytest.mark.parametrize(
    ("ratio", "said"), [(1.0004, "(just beyond its limit)"), (2.034, "(2.03 of its limit)")]
)
def test_a_weight_that_is_just_too_great_is_not_said_to_be_all_of_the_limit(ratio, said):
    trajectory = SimpleNamespace(position_error=np.zeros(3))
    report = SimpleNamespace(self_collisions=0, position=0, torque=1, torque_ratio=ratio)
    assert why_not(trajectory, report, MappingSettings()).endswith(said)
