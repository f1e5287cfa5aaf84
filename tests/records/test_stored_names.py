"""Files of before the modules moved: written by commit 58ea6d7, one of every kind of record."""

import pickle
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from besman.records import Landing, Origin, Record, Recording
from besman.records import files as record_files
from besman.records.files import load_record, save_record

# Kinds of record that there were not then.
# Of these, those that are written and read where they are made, in tests/stages.
ELSEWHERE = {
    "BlockDemonstration",
    "MappedTask",
    "BlockPlan",
    "TaskPlan",
    "besman.stages.refine.class_model:ClassModel",
    "TaskTrial",
    "RefinedTask",
}
SINCE = {"besman.records:Landing", "besman.records:Origin"} | ELSEWHERE
WRITTEN = sorted((Path(__file__).parent / "written_by_58ea6d7").glob("*.npz"))


def _all_records(kind=Record):
    for one in kind.__subclasses__():
        if one.__module__.startswith("besman."):
            yield one
            yield from _all_records(one)


def _records_in(value):
    if isinstance(value, Record):
        yield type(value)
        for one in fields(value):
            yield from _records_in(getattr(value, one.name))
    elif isinstance(value, tuple):
        for item in value:
            yield from _records_in(item)


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.stem)
def test_a_file_of_before_the_move_is_loaded_and_saved_to_the_same_bytes(path, tmp_path):
    save_record(load_record(path), tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_every_record_has_its_name_in_the_table_and_a_file_of_before():
    written = {kind for path in WRITTEN for kind in _records_in(load_record(path))}
    assert len({kind.stored_as for kind in written}) == len(written)
    assert {kind.stored_as for kind in written} == set(record_files._RECORDS) - SINCE
    assert {kind for kind in _all_records() if kind.stored_as not in SINCE} == written


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.stem)
def test_arrays_stay_read_only_in_another_process(path):
    (record,) = load_record(path)
    again = pickle.loads(pickle.dumps(record))
    arrays = [getattr(again, one.name) for one in fields(again)]
    for array in arrays:
        if isinstance(array, np.ndarray):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0


def test_what_has_come_since_is_stored_where_it_is_there(tmp_path):
    origin = Origin("C3D", "Nexus", "mm", "the file", "-y", "asked for", ("one", "two"))
    recording = Recording([0.0, 0.1], np.ones((2, 1, 3)), ("a",), 10.0, "a.c3d", origin=origin)
    save_record(recording, tmp_path / "a.npz")
    assert load_record(tmp_path / "a.npz").origin == origin
    landing = Landing("a.c3d", 2, np.array([3.0, 1.0, 0.0]))
    save_record((landing,), tmp_path / "b.npz")
    (again,) = load_record(tmp_path / "b.npz")
    assert (again.recording, again.throw) == ("a.c3d", 2)
    np.testing.assert_array_equal(again.place, landing.place)
    found = {kind.stored_as for kind in _records_in((recording, landing))}
    assert found >= SINCE - ELSEWHERE
    assert record_files.digest(recording) != record_files.digest(replace(recording, origin=None))
