"""`besman export`: a run as a log, read back by another library."""

import json

import numpy as np
import pytest
from mcap_ros2.reader import read_ros2_messages
from typer.testing import CliRunner

from besman.cli.main import app
from besman.exceptions import FileError, RunError
from besman.pipeline.finished_run import read_run
from besman.pipeline.run_log import export_run, read_log
from besman.pipeline.stored_run import open_run
from besman.robot.kinematics import forward_kinematics


@pytest.fixture(scope="module")
def log(small_run):
    return read_log(open_run(small_run))


def test_a_motion_begins_with_the_movement_that_it_is_made_of(small_run, log):
    (recording,) = log.markers
    (found,) = open_run(small_run).record("recognize")
    (whole,) = open_run(small_run).record("label")
    np.testing.assert_allclose(np.diff(recording.time), 1 / whole.rate_hz)
    np.testing.assert_array_equal(recording.positions, whole.positions)
    ends = 0.0
    for motion, logged in zip(read_run(small_run).motions, log.movements[""], strict=True):
        index = int(motion.plan.name.rpartition(":")[2])
        begun = recording.time[found.bounds[index, 0]]
        assert logged.start_s == pytest.approx(max(begun, ends))
        ends = logged.start_s + motion.time[-1] + 0.01
    labels = [one.label for one in log.events if one.kind == "block"]
    assert labels == list(found.labels)


def test_the_tool_is_where_the_robot_has_it(small_run, log):
    run = read_run(small_run)
    for motion, logged in zip(run.motions, log.movements[""], strict=True):
        tip = logged.poses[:, logged.frames.index("tcp"), :3]
        expected = forward_kinematics(run.robot.chain, motion.positions[logged.rows])[:, :3, 3]
        np.testing.assert_allclose(tip, expected, atol=1e-9)
        assert "world" not in logged.frames


def test_the_command_writes_beside_the_run(small_run):
    done = CliRunner().invoke(app, ["export", str(small_run), "--to", "mcap"])
    assert done.exit_code == 0, done.output
    path = small_run.parent / "run.mcap"
    n_motions = len(read_run(small_run).motions)
    assert f"wrote {path}: 1 recordings, {n_motions} motions, " in done.output
    found = [m for m in read_ros2_messages(str(path)) if m.channel.topic == "/joint_trajectory"]
    assert len(found) == n_motions
    folder, _ = export_run(small_run, "bag")
    assert folder == small_run.parent / "run_bag"
    assert sorted(one.name for one in folder.iterdir()) == ["metadata.yaml", "run_bag.db3"]
    with pytest.raises(FileError, match="run_bag: is there already"):
        export_run(small_run, "bag")


def test_episodes_are_motions(small_run, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    folder, said = export_run(small_run, "lerobot", tmp_path / "set")
    motions = read_run(small_run).motions
    assert said.startswith(f"{len(motions)} episodes, ")
    table = parquet.read_table(folder / "data/chunk-000/file-000.parquet").to_pydict()
    states, actions = (np.array(table[key]) for key in ("observation.state", "action"))
    first = motions[0].positions[::10]
    np.testing.assert_allclose(states[: len(first)], first, atol=1e-6)
    np.testing.assert_array_equal(actions[: len(first) - 1], states[1 : len(first)])
    np.testing.assert_allclose(actions[len(first) - 1], motions[0].positions[-1], atol=1e-6)


def test_what_is_no_finished_run_is_one_line(small_run, tmp_path):
    with pytest.raises(RunError, match="--to: got 'csv'; expected one of mcap, bag, lerobot"):
        export_run(small_run, "csv", tmp_path / "a")
    with pytest.raises(RunError, match=r"not a run: run\.json is missing"):
        export_run(tmp_path, "mcap", tmp_path / "a")
    state = json.loads((small_run / "run.json").read_text())
    other = tmp_path / "run"
    other.mkdir()
    (other / "pipeline.yaml").write_text((small_run / "pipeline.yaml").read_text())
    for change, said in (
        ({"status": "failed"}, "is failed; expected a finished run"),
        ({"stages": []}, "no refined motions here"),
    ):
        (other / "run.json").write_text(json.dumps(state | change))
        with pytest.raises(RunError, match=said):
            export_run(other, "mcap", tmp_path / "a")
    with pytest.raises(FileError, match="there is no folder"):
        export_run(small_run, "mcap", tmp_path / "none" / "a.mcap")
    assert not (tmp_path / "a").exists()
