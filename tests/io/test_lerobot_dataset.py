"""Datasets of LeRobot, version 3: read back as its own library does, by pyarrow and pandas."""

import json
import sys

import numpy as np
import pytest

from besman.exceptions import FileError
from besman.io.lerobot_dataset import Episode, write_lerobot

JOINTS = ("a_joint", "b_joint")
# Of no extra: with what it brings it has several gigabytes, and nothing else of them is used.
LIBRARY = "lerobot.datasets.lerobot_dataset"


@pytest.fixture(scope="module")
def episodes():
    draw = np.random.default_rng(1)
    return [
        Episode(draw.normal(size=(n, 2)), draw.normal(size=(n, 2)), task)
        for n, task in ((7, "throw"), (5, "strike_out"), (9, "throw"))
    ]


def test_a_dataset_is_read_back(episodes, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    pandas = pytest.importorskip("pandas")
    folder = tmp_path / "set"
    write_lerobot(folder, episodes, JOINTS, "ur5", 100)
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 100, "ur5")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 21, 2)
    data = folder / info["data_path"].format(chunk_index=0, file_index=0)
    table = parquet.read_table(data)
    assert parquet.read_metadata(data).num_row_groups == 3
    assert set(table.column_names) == set(info["features"])
    for name, feature in info["features"].items():
        kind, shape = table.schema.field(name).type, feature["shape"]
        if shape == [1]:
            assert str(kind).replace("float", "float32") == feature["dtype"]
        else:
            assert (kind.list_size, str(kind.value_type)) == (shape[0], "float")
    frames = table.to_pydict()
    for name, key in (("observation.state", "states"), ("action", "actions")):
        whole = np.concatenate([getattr(one, key) for one in episodes])
        np.testing.assert_array_equal(np.array(frames[name]), whole.astype(np.float32))
    assert frames["index"] == list(range(21))
    tasks = pandas.read_parquet(folder / "meta/tasks.parquet")
    assert (tasks.index.name, dict(tasks.task_index)) == ("task", {"throw": 0, "strike_out": 1})
    rows = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for index, (row, one) in enumerate(zip(rows, episodes, strict=True)):
        assert (row["episode_index"], row["length"]) == (index, len(one.states))
        part = slice(row["dataset_from_index"], row["dataset_to_index"])
        assert frames["episode_index"][part] == [index] * row["length"]
        assert frames["frame_index"][part] == list(range(row["length"]))
        np.testing.assert_allclose(
            frames["timestamp"][part], np.arange(row["length"]) / 100, atol=1e-6
        )
        assert row["tasks"] == [one.task]
        assert set(frames["task_index"][part]) == {tasks.loc[one.task].task_index}
        np.testing.assert_allclose(row["stats/action/mean"], one.actions.mean(axis=0), atol=1e-6)
    stats = json.loads((folder / "meta/stats.json").read_text())
    states = np.concatenate([one.states for one in episodes])
    np.testing.assert_allclose(stats["observation.state"]["std"], states.std(axis=0), atol=1e-6)
    np.testing.assert_allclose(stats["action"]["min"], np.array(frames["action"]).min(axis=0))
    assert stats["index"]["count"] == [21]


def test_same_episodes_give_same_bytes(episodes, tmp_path):
    pytest.importorskip("pyarrow")
    for name in ("one", "two"):
        write_lerobot(tmp_path / name, episodes, JOINTS, "ur5", 100)
    files = [one.relative_to(tmp_path / "one") for one in (tmp_path / "one").rglob("*.*")]
    assert len(files) == 5
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


def test_what_cannot_be_written_is_one_line(episodes, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(FileError, match="set: cannot be written: pyarrow"):
        write_lerobot(tmp_path / "set", episodes, JOINTS, "ur5", 100)
    monkeypatch.setitem(sys.modules, "pyarrow", json)
    with pytest.raises(FileError, match="there is no motion to be an episode"):
        write_lerobot(tmp_path / "set", [], JOINTS, "ur5", 100)
    assert not (tmp_path / "set").exists()


def test_the_formats_own_library_reads_it(episodes, tmp_path, monkeypatch):
    """A large package, of no extra: skipped without. It was read so by lerobot 0.4.2."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    library = pytest.importorskip(LIBRARY)
    folder = tmp_path / "set"
    write_lerobot(folder, episodes, JOINTS, "ur5", 100)
    found = library.LeRobotDataset("besman/set", root=folder)
    assert (len(found), found.num_episodes, found.meta.fps) == (21, 3, 100)
    assert found.meta.robot_type == "ur5"
    row = 0
    for index, episode in enumerate(episodes):
        for k, (state, action) in enumerate(zip(episode.states, episode.actions, strict=True)):
            one = found[row]
            assert (int(one["episode_index"]), one["task"]) == (index, episode.task)
            assert float(one["timestamp"]) == pytest.approx(k / 100, abs=1e-6)
            np.testing.assert_array_equal(one["observation.state"], state.astype(np.float32))
            np.testing.assert_array_equal(one["action"], action.astype(np.float32))
            row += 1
    chosen = library.LeRobotDataset("besman/set", root=folder, episodes=[1])
    assert len(chosen) == len(episodes[1].states)
