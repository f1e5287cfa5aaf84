import dataclasses
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.exceptions import RunError
from besman.records import CartesianPlan, MotionPlan, Recording, Segments
from besman.records import files as record_files
from besman.records.files import digest, load_record, save_record

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-5, 5)
    | st.text("aZ0 äß漢:_-.[]{}", max_size=5)
    | st.floats()
)


def _recording(value=0.0):
    positions = np.full((4, 2, 3), value)
    positions[1, 0] = np.nan
    return Recording(np.arange(4.0), positions, ("a", None), 60.0, "x.tsv", 7)


def test_round_trip_of_a_tuple_of_records(tmp_path):
    records = (_recording(), Segments([[0, 2], [2, 4]], -1.5, 60.0, "x.tsv"), None)
    save_record(records, tmp_path / "r.npz")
    again = load_record(tmp_path / "r.npz")
    assert digest(again) == digest(records)
    np.testing.assert_array_equal(again[0].positions, records[0].positions)
    assert again[0].names == ("a", None)


@given(st.lists(st.lists(SCALARS, max_size=3), max_size=3))
def test_round_trip_of_nested_values(tmp_path_factory, nested):
    path = tmp_path_factory.mktemp("r") / "r.npz"
    value = tuple(tuple(inner) for inner in nested)
    save_record(value, path)
    assert repr(load_record(path)) == repr(value)


def _plan(**more):
    return MotionPlan(
        np.ones((2, 5)), np.zeros(2), np.ones(2), 0.8, ("one", "two"), 0.1,
        np.array([0.0, 0, 0, 1, 0, 0, 0]), np.full(3, np.nan), "a", "throw", **more,
    )  # fmt: skip


def _cartesian_plan():
    pose = np.array([0.5, 0, 1, 0, 1, 0, 0])
    return CartesianPlan(
        np.ones((6, 5)), pose, pose, 0.8, np.zeros(2), ("one", "two"), 0.1, True, 0.1,
        pose, np.full(3, np.nan), "a", "throw",
    )  # fmt: skip


@pytest.mark.parametrize(
    "plan",
    [
        _plan(),
        _plan(kind="joint_dmp_velocity", goal_velocity=np.ones(2), lead_out_s=0.2),
        _cartesian_plan(),
    ],
)
def test_round_trip_of_motion_plans(tmp_path, plan):
    save_record((plan,), tmp_path / "r.npz")
    (again,) = load_record(tmp_path / "r.npz")
    assert type(again) is type(plan)
    assert digest(again) == digest(plan)


def test_a_motion_plan_of_before_there_were_kinds_is_a_joint_dmp(tmp_path, monkeypatch):
    known = ("weights", "start", "goal", "duration", "joint_names", "rmse", "goal_pose")
    known += ("target", "name", "label")
    fields = [field for field in dataclasses.fields(MotionPlan) if field.name in known]
    monkeypatch.setattr(record_files.dataclasses, "fields", lambda _: fields)
    save_record(_plan(), tmp_path / "r.npz")
    monkeypatch.undo()
    assert digest(load_record(tmp_path / "r.npz")) == digest(_plan())


def test_same_record_same_bytes(tmp_path):
    save_record(_recording(), tmp_path / "a.npz")
    save_record(_recording(), tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_digest_sees_every_value():
    assert digest(_recording()) == digest(_recording())
    assert digest(_recording()) != digest(_recording(1e-300))
    assert digest((1, "a")) != digest(("a", 1))


def test_damaged_file(tmp_path):
    save_record(_recording(), tmp_path / "r.npz")
    (tmp_path / "r.npz").write_bytes((tmp_path / "r.npz").read_bytes()[:-200])
    with pytest.raises(RunError, match="cannot be read as a record"):
        load_record(tmp_path / "r.npz")


@pytest.mark.parametrize("name", ["os:system", "besman.run:Run", "besman.records:nothing"])
def test_a_file_cannot_name_other_code(tmp_path, name):
    save_record(_recording(), tmp_path / "r.npz")
    with zipfile.ZipFile(tmp_path / "r.npz") as archive:
        parts = {entry: archive.read(entry) for entry in archive.namelist()}
    tree = json.dumps({"record": name, "fields": {}})
    import io

    buffer = io.BytesIO()
    np.save(buffer, np.array(tree))
    with zipfile.ZipFile(tmp_path / "evil.npz", "w") as archive:
        for entry, content in parts.items():
            archive.writestr(entry, buffer.getvalue() if "tree" in entry else content)
    with pytest.raises(RunError, match="is not a record of besman"):
        load_record(tmp_path / "evil.npz")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"names": ("a", "a")}, "names must be names, none empty and none twice"),
        ({"names": (" ", "a")}, "names must be names, none empty"),
        ({"first_frame": -1}, r"first_frame must be 0 to 1e\+09"),
        ({"first_frame": 10**9}, "first_frame must be"),
        ({"orientations": np.full((2, 2, 4), 1e300)}, "orientations must be unit quaternions"),
        ({"orientations": np.zeros((2, 2, 4))}, "orientations must be unit quaternions"),
    ],
)
def test_a_recording_that_no_camera_delivers_is_refused(tmp_path, change, message):
    good = Recording(np.arange(2.0), np.zeros((2, 2, 3)), ("a", None), 1.0, "a.tsv")
    save_record(good, tmp_path / "good.npz")
    assert load_record(tmp_path / "good.npz").names == ("a", None)
    save_record(dataclasses.replace(good, **change), tmp_path / "r.npz")
    with pytest.raises(RunError, match=message):
        load_record(tmp_path / "r.npz")


def test_what_is_no_record_is_refused(tmp_path):
    with pytest.raises(RunError, match="a set is no part of a record"):
        save_record({1}, tmp_path / "r.npz")
