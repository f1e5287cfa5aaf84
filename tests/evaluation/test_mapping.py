"""The study of embodiment mapping: its figures against hand-made ones, and as a whole."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import besman
from rich.console import Console
from scipy.spatial.distance import cdist
from small_runs import keep_demonstrations

from besman.cli import main as cli
from besman.evaluation import mapping as study
from besman.evaluation.mapping import (
    TransferMeasures,
    average_dtw,
    evaluate_mapping,
    measure,
    transfer_figures,
)
from besman.evaluation.mapping_data import (
    DemonstrationSet,
    choose_sets,
    load_demonstrations,
    simulate_throw_set,
    subject_of,
)
from besman.evaluation.mapping_figures import write_mapping_figures
from besman.evaluation.mapping_tables import mapping_tables, reason_lines
from besman.exceptions import ConfigError, MappingError
from besman.records import Failure, HandTrajectory, JointTrajectory
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.stages.map.stage import MapConfig
from besman.synthetic.datasets import write_synthetic
from besman.work.in_worker import peak_rss_mb

UR5 = load_robot("ur5", "stick_holder")
QUICK = MapConfig(evaluations=20, yaw=False)


def brute_force_dtw(first, second):
    """Least sum of distances over all warping paths, by recursion over the last step."""
    cost = cdist(first, second)

    def least(i, j):
        if i == j == 0:
            return cost[0, 0]
        before = [
            least(a, b) for a, b in ((i - 1, j), (i, j - 1), (i - 1, j - 1)) if min(a, b) >= 0
        ]
        return cost[i, j] + min(before)

    return least(len(first) - 1, len(second) - 1) / max(len(first), len(second))


@pytest.mark.parametrize(("n_first", "n_second"), [(1, 1), (4, 6), (6, 3), (5, 5)])
def test_average_dtw_against_all_warping_paths(n_first, n_second):
    rng = np.random.default_rng(n_first)
    first, second = rng.normal(size=(n_first, 3)), rng.normal(size=(n_second, 3))
    assert average_dtw(first, second) == pytest.approx(brute_force_dtw(first, second), rel=1e-12)


def test_average_dtw_forgives_another_pace_but_not_another_place():
    path = np.linspace([0.0, 0, 0], [1.0, 0, 0], 11)
    slow = np.repeat(path, 3, axis=0)
    assert average_dtw(path, slow) == 0.0
    assert average_dtw(path, path + np.array([0.0, 0.02, 0.0])) == pytest.approx(0.02)


def trajectory(name="a.tsv:0", errors_m=(0.0, 0.0, 0.0), errors_deg=(0.0, 0.0, 0.0), stretch=1.0):
    """An arm that rests at home for two tenths of a second."""
    pose = np.r_[forward_kinematics(UR5.chain, UR5.home)[:3, 3], 1.0, 0, 0, 0]
    still = np.zeros((3, UR5.n))
    return JointTrajectory(
        time=[0.0, 0.1, 0.2],
        positions=still + UR5.home,
        velocities=still,
        accelerations=still,
        joint_names=UR5.joint_names,
        poses=np.tile(pose, (3, 1)) + np.outer(errors_m, [1.0, 0, 0, 0, 0, 0, 0]),
        position_error=errors_m,
        orientation_error=np.radians(errors_deg),
        time_stretch=stretch,
        target=np.full(3, np.nan),
        name=name,
        label="throw",
    )


def test_figures_of_trajectories_with_known_errors():
    own = [
        trajectory(errors_m=(0.01, 0.02, 0.03), errors_deg=(1.0, 2.0, 6.0)),
        trajectory(errors_m=(0.0, 0.0, 0.06), stretch=1.0 + 1e-9),
        trajectory(stretch=1.5),
        trajectory(stretch=3.0),
    ]
    measured = [
        TransferMeasures(1, 0, 0.01),
        TransferMeasures(2, 5, 0.02),
        TransferMeasures(0, 0, 0.03),
        TransferMeasures(0, 1, 0),
    ]
    found = transfer_figures(own, measured)
    errors = [0.01, 0.02, 0.03, 0.0, 0.0, 0.06] + 6 * [0.0]
    assert found["position_error_m"] == pytest.approx(
        {"mean": 0.01, "p95": np.percentile(errors, 95), "max": 0.06}
    )
    assert found["orientation_error_deg"]["mean"] == pytest.approx(9 / 12)
    assert found["orientation_error_deg"]["max"] == pytest.approx(6.0)
    assert found["unscaled_share"] == 0.5
    assert found["time_stretch"]["median"] == pytest.approx(1.25)
    assert found["time_stretch"]["max"] == 3.0
    assert (found["limit_violations"], found["self_collisions"]) == (3, 6)
    assert found["dtw_m"] == pytest.approx({"mean": 0.015, "p95": 0.0285, "max": 0.03})
    none = transfer_figures([], [])
    assert none["position_error_m"] is none["unscaled_share"] is none["dtw_m"] is None
    assert none["limit_violations"] == none["self_collisions"] == 0


def test_measuring_a_trajectory_at_1_khz():
    still = measure(trajectory(errors_m=(0.03, 0.03, 0.03)), UR5)
    assert (still.limit_violations, still.self_collisions) == (0, 0)
    assert still.dtw_m == pytest.approx(0.03)
    fast = trajectory()
    time = fast.time
    speed = 1.5 * UR5.limits.velocity[0]
    moving = np.zeros((3, UR5.n))
    moving[:, 0] = speed
    fast = replace(fast, positions=fast.positions + np.outer(time, moving[0]), velocities=moving)
    assert measure(fast, UR5).limit_violations == 201
    # Folded back into its own base.
    folded = trajectory()
    folded = replace(folded, positions=folded.positions * 0 + [0, 1.5, 2.7, 0, 0, 0])
    assert measure(folded, UR5).self_collisions == 201


def throw(name, size=1.0, n_samples=51):
    """A dart-like throw of half a second."""
    time = np.linspace(0, 0.5, n_samples)
    u = time / 0.5
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = np.array([0.1, -0.4, 0.15]) + size * np.outer(u, [0.5, 0.1, 0.3])
    palm = np.tile([0.5, -0.5, -0.5, 0.5], (n_samples, 1))
    return HandTrajectory(time, np.hstack([path, palm]), name, "throw")


def spoilt(name, **changes):
    """A throw with other poses or times."""
    good = throw(name)
    poses = np.array(good.poses)
    for rows, columns, value in changes.get("poses", ()):
        poses[rows, columns] = value
    n = changes.get("n_samples", len(poses))
    return HandTrajectory(good.time[:n], poses[:n], name, "throw")


def test_bad_demonstrations_are_rows_with_their_reasons():
    every = slice(None)
    demonstrations = (
        throw("s1_a.tsv:0"),
        spoilt("s1_a.tsv:1", n_samples=1),
        spoilt("s1_a.tsv:2", poses=[(20, every, np.nan)]),
        throw("s1_a.tsv:3", size=17.0),
        spoilt("s1_a.tsv:4", poses=[(every, slice(3, 7), 0.0)]),
        throw("s2_a.tsv:5"),
        spoilt("s2_a.tsv:6", n_samples=3),
    )
    gap = (Failure("s1_a.tsv:9", "'hand_top' is not seen in frames 3 to 90; gaps up to ..."),)
    own = DemonstrationSet("d", "real", "throw", demonstrations, gap, "stick_holder", True)
    result, mapped = evaluate_mapping([own], ["ur5"], config=QUICK)
    (row,) = result["rows"]
    reasons = {one["name"][-1]: one["reason"] for one in row["failed"]}
    assert reasons["1"] == "expected a demonstration of at least three poses, got 1"
    assert reasons["2"].startswith("expected finite poses and rising times, got NaN")
    assert reasons["3"].startswith("its tool's places are up to 10.06 m apart, the arm's at most")
    assert reasons["4"] == "got a quaternion of zero"
    assert reasons["9"].startswith("'hand_top' is not seen in frames 3 to 90")
    assert row["n_demonstrations"] == 8
    assert row["n_transferred"] == len(mapped[0].trajectories) == 8 - len(reasons)
    assert row["transferred_to_all"] == row["n_transferred"] / 8
    lines = reason_lines(result["rows"])
    assert f"ur5, throw: s1_a.tsv:4: {reasons['4']}" in lines


def test_where_nothing_can_be_transferred_there_is_a_row_and_a_table(tmp_path):
    far = DemonstrationSet("d", "real", "throw", (throw("s1_a.tsv:0", size=17.0),))
    empty = DemonstrationSet("d", "real", "hold", (), (Failure("s1_a.tsv:1", "a gap"),))
    result, mapped = evaluate_mapping([far, empty], ["ur5"], config=QUICK)
    first, second = result["rows"]
    reason = "map: ur5 (tool gripper) is too short for all of 1 "
    assert first["failed"][0]["reason"].startswith(reason)
    assert second["failed"] == [{"name": "s1_a.tsv:1", "reason": "a gap"}]
    assert first["n_transferred"] == second["n_transferred"] == 0
    assert json.loads(json.dumps(result))["rows"][1]["position_error_m"] is None
    text = render(result["rows"])
    assert "0/1" in text
    assert write_mapping_figures(mapped, tmp_path) == []


def test_shares_count_what_every_robot_can_do(monkeypatch):
    demonstrations = tuple(throw(f"s1_a.tsv:{k}") for k in range(4))
    own = DemonstrationSet("stick_throw", "synthetic", "throw", demonstrations)
    bad = {"ur5": (0,), "ur10": (0, 3)}

    def fake(stage, one, robot, work, notes):
        class Result:
            trajectories = tuple(
                trajectory(f"s1_a.tsv:{k}") for k in range(4) if k not in bad[robot.name]
            )
            failed = tuple(Failure(f"s1_a.tsv:{k}", "no") for k in bad[robot.name])
            corrected, scale = (), 1.0

        return Result, Result.failed

    monkeypatch.setattr(study, "_try_mapping", fake)
    rows = evaluate_mapping([own], ["ur5", "ur10"])[0]["rows"]
    assert [row["n_transferred"] for row in rows] == [3, 2]
    assert [row["transferred_to_all"] for row in rows] == [0.5, 0.5]
    assert rows[0]["thesis"] == {"n_demonstrations": 697, "n_transferred_to_all": 682}
    assert "682 of 697" in render(rows)


def render(rows):
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    for table in mapping_tables(rows):
        console.print(table)
    return " ".join(console.export_text().split())


def test_the_number_of_jobs_changes_no_figure():
    own = simulate_throw_set(2, 1)
    rows = []
    for jobs in (1, 2):
        (row,) = evaluate_mapping([own], ["ur5"], config=QUICK, work=study.Work(jobs))[0]["rows"]
        rows.append({k: v for k, v in row.items() if "seconds" not in k and k != "peak_rss_mb"})
    assert rows[0] == rows[1]


def test_simulated_throws_have_subjects_and_targets():
    own = simulate_throw_set(2, 3)
    assert (own.n, own.tool, own.free_spin) == (6, "stick_holder", True)
    assert [subject_of(one.name) for one in own.demonstrations] == 3 * ["subject1"] + 3 * [
        "subject2"
    ]
    assert all(np.isfinite(one.target).all() for one in own.demonstrations)


def test_two_arms_are_followed_each_in_its_own_layer(tmp_path):
    write_synthetic("object_rotation", tmp_path / "two", 1, 2)
    sets = load_demonstrations(tmp_path / "two")
    assert {one.source for one in sets} == {"synthetic"}
    assert {one.tool for one in sets} == {"gripper"}
    labels = [one.label for one in sets]
    assert len(set(labels)) == len(labels)
    both = [label for label in labels if label.endswith("(left)")]
    for label in both:
        right, left = (
            next(one for one in sets if one.label == label.replace("left", side))
            for side in ("right", "left")
        )
        assert right.demonstrations[0].poses[0, 1] < left.demonstrations[0].poses[0, 1]
    assert both


def test_bad_requests(tmp_path):
    with pytest.raises(ConfigError, match="--data and --subjects or --repetitions: got both"):
        choose_sets(tmp_path, 1)
    write_synthetic("step", tmp_path / "steps", 1, 1)
    for path in (tmp_path / "steps").glob("*.json"):
        path.unlink()
    with pytest.raises(MappingError, match="steps: no labelled segments; expected recordings"):
        choose_sets(tmp_path / "steps")
    own = DemonstrationSet("d", "real", "throw", (throw("s1_a.tsv:0"),))
    with pytest.raises(ConfigError, match="--robot: got one robot twice: ur5, ur5"):
        evaluate_mapping([own], ["ur5", "ur5"])


@pytest.mark.slow
def test_the_study_by_its_command(tmp_path, monkeypatch, capsys):
    # Fewer placements to try than usual.
    monkeypatch.setitem(evaluate_mapping.__kwdefaults__, "config", QUICK)
    arguments = ["--subjects", "2", "--repetitions", "1", "--robot", "ur5", "--robot", "ur10"]
    out = ["--json", str(tmp_path / "rows.json"), "--figures", str(tmp_path / "figures")]
    assert besman(monkeypatch, "evaluate", "mapping", *arguments, *out) == 0
    content = json.loads((tmp_path / "rows.json").read_text())
    assert content["experiment"] == "mapping"
    assert [row["robot"] for row in content["rows"]] == ["ur5", "ur10"]
    for row in content["rows"]:
        assert row["n_transferred"] == row["n_transferred_to_all"] == row["n_demonstrations"] == 2
        assert row["position_error_m"]["p95"] < 0.03
        assert row["limit_violations"] == row["self_collisions"] == 0
        assert row["dtw_m"]["max"] < 0.03
        assert 0.5 < row["peak_rss_mb"] / peak_rss_mb() <= 1.0
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == [
        f"stick_throw_throw_{kind}.png" for kind in ("spread", "subject", "workspaces")
    ]
    printed = " ".join(capsys.readouterr().out.split())
    assert "2/2" in printed
    assert "682 of 697" in printed


@pytest.mark.slow
def test_an_exoskeleton_s_recording_becomes_a_robot_s_movement(tmp_path, monkeypatch):
    found = keep_demonstrations(monkeypatch, 2)
    write_synthetic("circle_drawing", tmp_path / "exo", 1, 3)
    settings = (
        f"recordings={tmp_path / 'exo'}", "label.markers=exoskeleton", "select.label=null",
        "select.action=circle_up", "recognize.examples_per_class=2", "map.evaluations=40",
        "compose={levels: [[move_to_start, circle_up, circle_down, move_to_rest, idle]]}",
        "refine.episodes=2", "refine.robustness=null", "map.yaw=false",
    )  # fmt: skip
    arguments = [part for one in settings for part in ("--set", one)]
    command = ["besman", "run", "ur5_reach", "--out", str(tmp_path / "run"), *arguments]
    monkeypatch.setattr("sys.argv", command)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert not stop.value.code
    mapped = json.loads((tmp_path / "run" / "results.json").read_text())["map"]
    assert len(found) > 1
    assert mapped["n_transferred"] == mapped["n_demonstrations"] == 2
    assert mapped["position_error_m"]["p95"] < 0.01
    assert mapped["limit_violations"] == mapped["self_collisions"] == 0
