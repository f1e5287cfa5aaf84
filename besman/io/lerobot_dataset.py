"""Datasets of the LeRobot format, version 3: tables as Parquet, what they mean as JSON.

The extra ``lerobot``, which is pyarrow alone. All episodes stand in one file of ``data/`` with one
row group each; ``meta/`` says where each begins, its task, and the statistics for normalizing.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import FileError, why_not_there
from besman.io.atomic_files import folder_aside, write_text
from besman.records import FloatArray

_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIRST = _FILE.format(chunk_index=0, file_index=0)
_QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)
_COUNTERS = ("frame_index", "episode_index", "index", "task_index")


@dataclass(frozen=True, eq=False)
class Episode:
    """One demonstration.

    Attributes
    ----------
    states, actions : array, shape (T, n)
        Angles of the joints, and what is commanded next, rad.
    task : str
        What is done in it.
    """

    states: FloatArray
    actions: FloatArray
    task: str


def write_lerobot(
    folder: Path,
    episodes: Sequence[Episode],
    joint_names: Sequence[str],
    robot: str,
    rate_hz: int,
) -> None:
    """Write episodes as a dataset.

    Parameters
    ----------
    folder : Path
        Which is not there; the folder above is.
    episodes : sequence of Episode
        At least one.
    joint_names : sequence of str, length n
    robot : str
        Its name.
    rate_hz : int
        Samples a second.

    Raises
    ------
    FileError
        If pyarrow is not installed, there is no episode, or it cannot be written.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError as error:
        reason = why_not_there(error, "pyarrow", "besman[lerobot]")
        raise FileError(f"{folder}: cannot be written: {reason}") from None
    if not episodes:
        raise FileError(f"{folder}: cannot be written: there is no motion to be an episode")
    tasks = list(dict.fromkeys(one.task for one in episodes))
    tables = [_columns(episodes, index, tasks, rate_hz) for index in range(len(episodes))]
    whole = {key: np.concatenate([table[key] for table in tables]) for key in tables[0]}
    with folder_aside(folder) as temporary:
        _write_frames(temporary / "data" / _FIRST, tables)
        _write_tasks(temporary / "meta" / "tasks.parquet", tasks)
        _write_episodes(temporary / "meta" / "episodes" / _FIRST, episodes, tables)
        _write_json(temporary / "meta" / "stats.json", {k: _stats(v) for k, v in whole.items()})
        info = _info(episodes, joint_names, robot, rate_hz, len(tasks))
        _write_json(temporary / "meta" / "info.json", info)


def _columns(
    episodes: Sequence[Episode], index: int, tasks: list[str], rate_hz: int
) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of one episode, in the order of the file."""
    one, n = episodes[index], len(episodes[index].states)
    before = sum(len(other.states) for other in episodes[:index])
    frames = np.arange(n)
    return {
        "action": one.actions.astype(np.float32),
        "observation.state": one.states.astype(np.float32),
        "timestamp": (frames / rate_hz).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(n, index),
        "index": before + frames,
        "task_index": np.full(n, tasks.index(one.task)),
    }


def _info(
    episodes: Sequence[Episode], joints: Sequence[str], robot: str, rate_hz: int, n_tasks: int
) -> dict[str, Any]:
    """Say what the dataset holds."""
    vector: dict[str, Any] = {"dtype": "float32", "shape": [len(joints)], "names": list(joints)}
    features = {"action": vector, "observation.state": vector}
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in _COUNTERS}
    return {
        "codebase_version": "v3.0",
        "robot_type": robot,
        "total_episodes": len(episodes),
        "total_frames": sum(len(one.states) for one in episodes),
        "total_tasks": n_tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate_hz,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{_FILE}",
        "video_path": None,
        "features": features,
    }


def _write_frames(path: Path, tables: Sequence[dict[str, npt.NDArray[Any]]]) -> None:
    """Write the samples, one row group an episode."""
    import pyarrow as pa
    from pyarrow import parquet

    made = [pa.table({key: _arrow(column) for key, column in one.items()}) for one in tables]
    path.parent.mkdir(parents=True)
    with parquet.ParquetWriter(path, made[0].schema, compression="snappy") as writer:
        for table in made:
            writer.write_table(table)


def _arrow(column: npt.NDArray[Any]) -> Any:
    """Return a column; vectors as lists of one length."""
    import pyarrow as pa

    if column.ndim == 1:
        return pa.array(column)
    return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel()), column.shape[1])


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """Write the tasks; pandas takes their texts for the index of the table."""
    import pyarrow as pa
    from pyarrow import parquet

    def describe(name: str, pandas: str, numpy: str) -> dict[str, Any]:
        return {
            "name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy,
            "metadata": None,
        }  # fmt: skip

    meaning = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            describe("task_index", "int64", "int64"),
            describe("task", "unicode", "object"),
        ],
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": tasks})
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(meaning)}), path)


def _write_episodes(
    path: Path, episodes: Sequence[Episode], tables: Sequence[dict[str, npt.NDArray[Any]]]
) -> None:
    """Write where each episode stands, and its statistics."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = []
    for index, (one, table) in enumerate(zip(episodes, tables, strict=True)):
        start = int(table["index"][0])
        row = {
            "episode_index": index,
            "tasks": [one.task],
            "length": len(one.states),
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": start,
            "dataset_to_index": start + len(one.states),
        }
        for key, column in table.items():
            row |= {f"stats/{key}/{name}": value for name, value in _stats(column).items()}
        rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
    path.parent.mkdir(parents=True)
    parquet.write_table(pa.Table.from_pylist(rows), path, compression="snappy")


def _stats(column: npt.NDArray[Any]) -> dict[str, list[float] | list[int]]:
    """Return the statistics of a column by which policies normalize it."""
    values = column.reshape(len(column), -1).astype(np.float64)
    found: dict[str, list[float] | list[int]] = {
        "min": values.min(axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
        "mean": values.mean(axis=0).tolist(),
        "std": values.std(axis=0).tolist(),
        "count": [len(values)],
    }
    for share, quantile in zip(_QUANTILES, np.quantile(values, _QUANTILES, axis=0), strict=True):
        found[f"q{round(100 * share):02d}"] = quantile.tolist()
    return found


def _write_json(path: Path, content: dict[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=4) + "\n", durable=False)
