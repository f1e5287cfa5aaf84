"""A run, logs of its motions, and the robot.yaml that comes of them."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml
from command_line import besman
from small_runs import refined

from besman.exceptions import RecordingError, RunError, TransferError
from besman.records.files import save_record
from besman.robot.drives import arrive_late
from besman.robot.model import find_robot, load_robot
from besman.simulation.arm_alone import follow_setpoints
from besman.transfer.identification.executions import as_movement, find_executions, read_logs
from besman.transfer.identification.fit import ArmLog, fit_drives, sent_setpoints
from besman.transfer.identification.identified_robot import place_of_identified
from besman.transfer.identification.identify import identify_arm
from besman.transfer.identification.quantities import quantities_of, values_of

STEP_S, NOISE_RAD = 0.002, 2e-5
NAMES = ("person.tsv:1", "person.tsv:12")
TRUTH = {
    "gains": [0.8, 0.9, 1.2, 1.1, 0.9, 1.0],
    "delays": [0.006] * 6,
    "lags": [0.0] * 6,
    "friction": [3.0, 2.0, 1.0, 0.3, 0.3, 0.2],
    "damping": [0.0] * 6,
    "payload": 0.5,
}


@pytest.fixture(scope="module", autouse=True)
def shorter():
    """Watch the arm after a movement for as long as these take to come to rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("besman.transfer.identification.fit._AFTER_S", 0.1)
        yield


@pytest.fixture(scope="module")
def motions(make_plan):
    return [refined(make_plan(0.54, name=NAMES[0])), refined(make_plan(0.6, name=NAMES[1]))]


@pytest.fixture(scope="module")
def run(tmp_path_factory, motions):
    """A run with an arm of its own: the UR5 under another name, in a file beside the run."""
    folder = tmp_path_factory.mktemp("made")
    content = yaml.safe_load(find_robot("ur5").read_text()) | {"name": "mine"}
    (folder / "mine.yaml").write_text(yaml.safe_dump(content))
    (folder / "run" / "08_refine").mkdir(parents=True)
    save_record(tuple(motions), folder / "run" / "08_refine" / "record.npz")
    (folder / "run" / "pipeline.yaml").write_text(
        f"name: made\nrecordings: [none]\nrobot: {folder / 'mine.yaml'}\ntool: stick_holder\n"
        "task: stick_throw\nselect: {label: throw}\n"
    )
    return folder / "run"


@pytest.fixture(scope="module")
def truth(robot):
    arrays = {key: np.array(one, dtype=float) for key, one in TRUTH.items() if key != "payload"}
    return replace(robot.drives, **arrays, payload=TRUTH["payload"])


@pytest.fixture(scope="module")
def paths(robot, motions, truth):
    """What an arm with these drives does: time (T,), angles (2, T, n)."""
    movements = [as_movement(one) for one in motions]
    late = arrive_late(sent_setpoints(robot, movements), truth, STEP_S)
    starts = np.stack([one.positions[0] for one in motions])
    found = follow_setpoints(replace(robot, drives=truth), starts, late, STEP_S)
    noise = NOISE_RAD * np.random.default_rng(0).standard_normal(found.shape)
    return STEP_S * np.arange(found.shape[1]), found + noise


@pytest.fixture
def log(tmp_path, robot, paths):
    """Write the log of a motion, in degrees, changed or not."""

    def write(name="person_1.csv", row=0, change=lambda table: table, joints=robot.joint_names):
        time, angles = paths
        table = change(np.column_stack([time, np.degrees(angles[row])])[::2])
        head = ",".join(["time_s", *(f"{joint}_deg" for joint in joints)])
        np.savetxt(tmp_path / name, table, delimiter=",", header=head, comments="", fmt="%.7f")
        return tmp_path / name

    return write


def test_a_command_finds_the_drives_and_a_run_can_start_from_them(
    run, log, robot, truth, monkeypatch, capsys, tmp_path
):
    shutil.copytree(run.parent, tmp_path / "made")
    mine = tmp_path / "made" / "run"
    text = (mine / "pipeline.yaml").read_text().replace(str(run.parent), str(mine.parent))
    (mine / "pipeline.yaml").write_text(text)
    before = (mine.parent / "mine.yaml").read_bytes()
    logs = tmp_path / "logs"
    logs.mkdir()
    log(), log("person_12 again.csv", 1)
    for path in tmp_path.glob("*.csv"):
        path.rename(logs / path.name)
    assert besman(monkeypatch, "identify", mine, logs, "--jobs", 1) == 0
    said = capsys.readouterr().out
    written = mine.parent / "mine.identified.yaml"
    assert f"--set robot={written}" in "".join(said.splitlines())
    assert (mine.parent / "mine.yaml").read_bytes() == before
    found = json.loads(written.with_suffix(".json").read_text())
    assert found["executions"] == [
        {"file": "person_1.csv", "motion": NAMES[0]},
        {"file": "person_12 again.csv", "motion": NAMES[1]},
    ]
    assert found["apart_rad"]["after"] < 3 * NOISE_RAD
    assert found["apart_rad"]["after"] < 0.1 * found["apart_rad"]["before"]
    expected = values_of(truth, quantities_of(robot, True))
    told = [
        (one["key"], one["joint"], one["value"], right, one["deviation"])
        for one, right in zip(found["quantities"], expected, strict=True)
        if one["told"]
    ]
    assert len(told) >= 15
    beside = [abs(value - right) / sure for _, _, value, right, sure in told]
    assert np.mean(np.array(beside) < 3.0) >= 0.9
    # What is written is loaded, and says where it comes from.
    arm = load_robot(written, "stick_holder")
    assert arm.name == "mine_identified"
    assert arm.drives.gains[1] == pytest.approx(0.9, abs=0.03)
    assert arm.drives.payload == pytest.approx(0.5, abs=0.15)
    content = yaml.safe_load(written.read_text())
    assert content["joints"][1]["origin"]["servo_gain"].startswith(
        "identified from 2 executions of run, standard deviation 0.0"
    )
    for one in found["quantities"]:
        if not one["told"]:
            assert one["value"] == one["before"]
            assert one["key"] in said
    # The next one goes beside it.
    path, name = place_of_identified(str(mine.parent / "mine.yaml"), mine)
    assert (path.name, name) == ("mine.identified2.yaml", "mine_identified2")


def test_where_it_goes(run, tmp_path):
    path, name = place_of_identified("ur5", run)
    assert (path, name) == (run / "identified" / "ur5.identified.yaml", "ur5_identified")
    assert place_of_identified("ur5", run, tmp_path)[0] == tmp_path / "ur5.identified.yaml"


def test_when_a_motion_was_sent_off_is_found_with_the_rest(robot, motions, paths, truth):
    """A log that begins 0.7 s before the motion, as a bag's may: delays are not sought."""
    time, angles = paths
    before = np.repeat(angles[0, :1], 350, axis=0)
    log = ArmLog(0, STEP_S * np.arange(350 + len(time)), np.concatenate([before, angles[0]]), False)
    fit = fit_drives(robot, [as_movement(one) for one in motions], [log])
    assert "delay_s" not in {one.key for one in fit.quantities}
    assert fit.apart < 5 * NOISE_RAD
    np.testing.assert_array_equal(fit.drives.delays, 0.0)
    at = [one.key for one in fit.quantities].index("servo_gain")
    assert fit.found.told[at]
    assert fit.found.values[at] == pytest.approx(TRUTH["gains"][0], abs=0.05)


def beside(table, joint=2, degrees=40.0):
    table = table.copy()
    table[:, joint + 1] += degrees * np.minimum(table[:, 0] / 0.2, 1.0)
    return table


def later(table, seconds=1000.0):
    return table + np.eye(7)[0] * seconds


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"change": lambda t: t[:100]}, "ends 0.40 s after motion .*:1 was sent off, which lasts"),
        ({"change": lambda t: t[::-1]}, "time is .* expected times that rise evenly"),
        ({"change": lambda t: np.delete(t, range(50, 70), 0)}, "expected times that rise evenly"),
        ({"change": later}, "begins at 1000 s; expected 0 where motion .* --fit-start if times"),
        (
            {"change": beside},
            "is not of motion person.tsv:1, or the run was computed anew since: joint elbow_joint "
            "is 0.6. rad beside it at .* s; expected at most 0.5",
        ),
        (
            {"change": lambda t: t + 20.0 * np.eye(7)[1]},
            "joint shoulder_pan_joint is 0.35 rad beside it at 0.00 s; expected at most 0.1",
        ),
        ({"joints": ["a", "b", "c", "d", "e", "f"]}, "a log of another arm: no joint shoulder_pan"),
    ],
)
def test_logs_that_cannot_be_used(run, log, values, message):
    """One line each, and nothing written."""
    there = sorted(run.parent.rglob("*"))
    with pytest.raises(RecordingError, match=message) as caught:
        identify_arm(run, [log(**values)])
    assert "\n" not in str(caught.value)
    assert sorted(run.parent.rglob("*")) == there


def test_what_was_asked_is_no_log(run, log, motions):
    """Who logs set-points, or gives the export itself, is not told that the arm is ideal."""
    motion = motions[0]
    asked = np.column_stack([motion.time, np.degrees(motion.positions)])
    with pytest.raises(RecordingError, match="is what was asked of the arm in motion person"):
        identify_arm(run, [log(change=lambda _: asked[::4])])


def test_logs_of_no_motion(run, log, motions, robot, tmp_path):
    path = log("throw.csv")
    with pytest.raises(
        TransferError, match=r"called like no motion of the run; .*person_1, person_"
    ):
        identify_arm(run, [path])
    with pytest.raises(TransferError, match=r"--motion: got 'x'; allowed: person.tsv:1, person"):
        identify_arm(run, [path], motion="x")
    (read,) = read_logs([path], motions, robot, motion=NAMES[0])
    assert (read.movement, read.is_aligned) == (0, True)
    (read,) = read_logs([path], motions, robot, NAMES[0], fit_start=True)
    assert not read.is_aligned
    with pytest.raises(TransferError, match="nowhere: no such file or folder"):
        find_executions([tmp_path / "nowhere"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(TransferError, match=r"empty: no logs here; expected files .csv, .mcap"):
        find_executions([tmp_path / "empty"])


def test_a_run_that_was_changed_since_it_ended(run, log, monkeypatch, tmp_path):
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "run.json").write_text("{}")
    faults = ["report.html is missing; besman report writes it", "limits.json: cut or changed"]
    module = "besman.transfer.identification.identify"
    monkeypatch.setattr(f"{module}.check_run", lambda folder: ([], faults))
    with pytest.raises(
        RunError, match=r"was changed since it ended: limits.json: cut or changed; "
    ):
        identify_arm(tmp_path / "run", [log()])
