"""Records to and from ``.npz`` files without pickle, and their digests for the cache."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from besman.exceptions import BesmanError, RunError
from besman.foreign.json_text import parse_json
from besman.records.frozen import Record
from besman.records.npz import ERRORS, Arrays
from besman.records.schema import check_fields

_TREE = "__tree__"

# The module in which the record of each name in files (`Record.stored_as`) stands today.
_RECORDS = {
    "BlockDemonstration": "besman.records.block_demonstrations",
    "BlockPlan": "besman.records.whole_tasks",
    "MappedTask": "besman.records.whole_tasks",
    "RefinedTask": "besman.records.task_trial",
    "TaskPlan": "besman.records.whole_tasks",
    "TaskTrial": "besman.records.task_trial",
    "besman.records:Failure": "besman.records.failure",
    "besman.records:Landing": "besman.records.landing",
    "besman.records:CartesianPlan": "besman.records.plans",
    "besman.records:MotionPlan": "besman.records.plans",
    "besman.records:LabelledRecording": "besman.records.recordings",
    "besman.records:Origin": "besman.records.recordings",
    "besman.records:Recording": "besman.records.recordings",
    "besman.records:RefinedMotion": "besman.records.refined_motion",
    "besman.records:Actions": "besman.records.segments",
    "besman.records:LabelledSegments": "besman.records.segments",
    "besman.records:Segments": "besman.records.segments",
    "besman.records:HandTrajectory": "besman.records.trajectories",
    "besman.records:JointTrajectory": "besman.records.trajectories",
    "besman.refinement.upper_level:UpperLevelPolicy": "besman.search.upper_level",
    "besman.simulation.trial:Trial": "besman.simulation.trial",
    "besman.hierarchy.actions:LevelModel": "besman.stages.compose.actions",
    "besman.labelling.record:NameDecision": "besman.stages.label.named_recording",
    "besman.labelling.record:NamedRecording": "besman.stages.label.named_recording",
    "besman.mapping.embodiment:Correction": "besman.stages.map.mapping",
    "besman.mapping.embodiment:Mapping": "besman.stages.map.mapping",
    "besman.recognition.model:Recipe": "besman.stages.recognize.model",
    "besman.recognition.model:RecognitionModel": "besman.stages.recognize.model",
    "besman.refinement.checkpoint:Generation": "besman.stages.refine.checkpoint",
    "besman.stages.refine.class_model:ClassModel": "besman.stages.refine.class_model",
    "besman.refinement.plan_space:Units": "besman.stages.refine.plan_space",
    "besman.refinement.robustness:Robustness": "besman.stages.refine.robustness",
    "besman.templates.learning:Tries": "besman.templates.learning",
    "besman.templates.template:PlanFamily": "besman.templates.template",
    "besman.templates.template:Template": "besman.templates.template",
    "besman.transfer.archive:Archive": "besman.transfer.archive",
}


def save_record(record: Any, path: Path) -> None:
    """Write a record, or a tuple of records, to one ``.npz`` file.

    The file holds the arrays and, as JSON text, the tree of records around them. The same record
    gives the same bytes.

    Parameters
    ----------
    record : record, tuple, str, number, bool, None or array
        Frozen dataclasses of besman and tuples of them.
    path : Path
        The file to write.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_encode(record, arrays), sort_keys=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in {**arrays, _TREE: np.array(tree)}.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=False)
            # A fixed date, so that the bytes depend on the content alone.
            archive.writestr(
                zipfile.ZipInfo(f"{name}.npy", (2000, 1, 1, 0, 0, 0)), buffer.getvalue()
            )


def load_record(path: Path, most_bytes: int | None = None) -> Any:
    """Read what `save_record` wrote.

    Parameters
    ----------
    path : Path
    most_bytes : int, optional
        Refuse a file whose arrays are larger together.

    Raises
    ------
    RunError
        If the file is missing, damaged, names a type that is not a record of besman, or holds
        fields that are none of the record's, of another type or shape, or not finite where they
        must be.
    """
    try:
        with Arrays(path, most_bytes) as arrays:
            return _decode(parse_json(str(arrays[_TREE])), arrays)
    except (*ERRORS, BesmanError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise RunError(f"{path}: cannot be read as a record: {reason}") from None


def digest(content: Any) -> str:
    """Return the SHA-256 of a record, config or tuple of them, as hexadecimal text."""
    sha = hashlib.sha256()
    arrays: dict[str, np.ndarray] = {}
    sha.update(json.dumps(_encode(content, arrays), sort_keys=True).encode())
    for name, array in arrays.items():
        sha.update(f"{name}:{array.dtype.str}:{array.shape}".encode())
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()


def _encode(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Turn a value into JSON, moving its arrays into `arrays`."""
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return _encode(value.item(), arrays)
    if isinstance(value, float):
        return {"float": value.hex()}
    if value is None or isinstance(value, str | int | bool):
        return value
    if isinstance(value, tuple | list):
        return {"tuple": [_encode(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": [[str(key), _encode(item, arrays)] for key, item in value.items()]}
    if isinstance(value, BaseModel):
        return {"config": value.model_dump(mode="json"), "type": type(value).__name__}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        record: Any = value if isinstance(value, Record) else None
        fields = {
            field.name: _encode(getattr(value, field.name), arrays)
            for field in dataclasses.fields(value)
            if record is None or not record.is_as_before(field.name)
        }
        return {"record": _stored_name(type(value)), "fields": fields}
    raise RunError(f"a {type(value).__name__} is no part of a record")


def _decode(tree: Any, arrays: Arrays) -> Any:
    """Undo `_encode`; what it never writes is a `ValueError` or `TypeError`."""
    if tree is None or isinstance(tree, str | int):
        return tree
    if not isinstance(tree, dict):
        raise ValueError(f"unknown entry {tree!r:.60}")
    if "array" in tree:
        return arrays[tree["array"]]
    if "float" in tree:
        return float.fromhex(tree["float"])
    if "tuple" in tree:
        return tuple(_decode(item, arrays) for item in _list(tree["tuple"]))
    if "dict" in tree:
        return {str(key): _decode(item, arrays) for key, item in _list(tree["dict"])}
    if "record" in tree:
        return _decode_record(tree, arrays)
    raise ValueError(f"unknown entry {sorted(tree)!r:.60}")


def _decode_record(tree: dict[str, Any], arrays: Arrays) -> Any:
    """Make a record of what a file says of its fields."""
    kind = _record_type(tree["record"])
    if not isinstance(tree.get("fields"), dict):
        raise ValueError(f"{kind.__name__} has no fields")
    fields = {name: _decode(item, arrays) for name, item in tree["fields"].items()}
    check_fields(kind, fields)
    record: Record = kind(**fields)
    record.check()
    return record


def _list(value: Any) -> list[Any]:
    """Return a list of the tree."""
    if not isinstance(value, list):
        raise ValueError(f"got {value!r:.60}, expected a list")
    return value


def _record_type(name: str) -> Any:
    """Find a record's class by its name in files, whatever else the file says."""
    if not isinstance(name, str) or name not in _RECORDS:
        raise ValueError(f"{name!r:.60} is not a record of besman")
    return getattr(importlib.import_module(_RECORDS[name]), name.rpartition(":")[2])


def _stored_name(kind: type[Any]) -> str:
    """Return a class' name for files and digests; what is no record is only ever digested."""
    return getattr(kind, "stored_as", f"{kind.__module__}:{kind.__qualname__}")
