# ruff: noqa: E501
import numpy as np
import pytest
from foreign_recordings import motive_lines, write_lines, y_up
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.conventions import BY_HABIT
from besman.io.recordings.formats import read_recording
from besman.io.recordings.motive_csv import read_motive_csv
from besman.records import Recording

RNG = np.random.default_rng(0)


def take(names=("Body", "Body:Marker1", None), first_frame=0, n_samples=20):
    time = np.arange(n_samples) / 50
    positions = RNG.normal([0, 0, 1], 0.3, size=(1, len(names), 3))
    positions = positions + 0.1 * np.sin(time)[:, None, None]
    positions[4:6, 1] = positions[-3:, -1] = np.nan
    turns = Rotation.random(n_samples * len(names), rng=1).as_quat(scalar_first=True)
    turns = turns.reshape(n_samples, len(names), 4)
    return Recording(time, positions, names, 50.0, "a.csv", first_frame, turns)


def assert_reads(lines, written, tmp_path, end="\r\n", **options):
    found = read_motive_csv(write_lines(lines, tmp_path / "a.csv", end), **options)
    np.testing.assert_allclose(found.positions, y_up(written.positions), atol=1e-8)
    np.testing.assert_allclose(found.time, written.time, atol=1e-6)
    assert (found.names, found.rate_hz) == (written.names, written.rate_hz)
    assert found.first_frame == written.first_frame
    assert (found.origin.up, found.origin.up_by) == ("y", BY_HABIT)
    return found


@pytest.mark.parametrize("version", ["1.21", "1.22", "1.23", "1.24", "1.25"])
@pytest.mark.parametrize("second", [None, "", ",,,,"])
@pytest.mark.parametrize("time", ["Time", "Time (Seconds)"])
@pytest.mark.parametrize("bodies", [0, 1])
def test_versions(tmp_path, version, second, time, bodies):
    written = take()
    lines = motive_lines(written, version, second=second, time=time, bodies=bodies)
    found = assert_reads(lines, written, tmp_path)
    assert found.origin.writer == f"Motive, format {version}"
    assert (found.orientations is not None) == bool(bodies)


@pytest.mark.parametrize("options", [{"labels": False}, {"parent": True}, {"timecode": True}, {"first_frame": 480}])  # fmt: skip
def test_rows_and_columns_of_the_header(tmp_path, options):
    written = take(first_frame=options.pop("first_frame", 0))
    assert_reads(motive_lines(written, bodies=1, **options), written, tmp_path)


@pytest.mark.parametrize(
    ("units", "scale"), [("Meters", 1), ("Millimeters", 1000), ("Centimeters", 100), ("Inches", 1 / 0.0254)]
)  # fmt: skip
def test_units(tmp_path, units, scale):
    written = take()
    found = assert_reads(motive_lines(written, units=units, scale=scale), written, tmp_path)
    assert found.origin.units_by == "the file"


def test_orientations_turn_with_the_frame(tmp_path):
    written = take()
    found = read_recording(write_lines(motive_lines(written, bodies=1), tmp_path / "a.csv"))
    np.testing.assert_allclose(found.positions, written.positions, atol=1e-8)
    one = Rotation.from_quat(found.orientations[:, 0], scalar_first=True)
    # The writer turns a body as its axes are named: x, z, -y.
    axes = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    other = Rotation.from_quat(written.orientations[:, 0], scalar_first=True)
    np.testing.assert_allclose((one.inv() * other * axes).magnitude(), 0, atol=1e-5)
    assert np.isnan(found.orientations[:, 1:]).all()


def test_saved_again_by_a_spreadsheet(tmp_path):
    written = take(("a", "b", "c"))
    lines = [line.replace('"', "") for line in motive_lines(written)]
    width = max(line.count(",") for line in lines)
    full = [line + (width - line.count(",")) * "," for line in lines]
    assert_reads(full, written, tmp_path)
    semicolons = [line.replace(",", ";").replace(".", ",") for line in full]
    semicolons[0] = full[0].replace(",", ";")
    assert_reads(semicolons, written, tmp_path)


def test_markers_computed_from_a_pose_give_way_to_measured_ones(tmp_path):
    written = take(("B:M1", "B:M2", "B:M1", "C:M1"))
    lines = motive_lines(written)
    at = next(k for k, line in enumerate(lines) if line.startswith(",Type"))
    kinds = [*3 * ["Rigid Body Marker"], *6 * ["Marker"], *3 * ["Rigid Body Marker"]]
    lines[at] = ",Type," + ",".join(kinds)
    found = read_motive_csv(write_lines(lines, tmp_path / "a.csv"))
    assert found.names == ("B:M2", "B:M1", "C:M1")
    np.testing.assert_allclose(found.positions, y_up(written.positions[:, 1:]), atol=1e-8)
    assert "1 markers that Motive computes from poses are left out" in found.origin.notes[0]


def test_bodies_keep_their_orientation_over_gaps(tmp_path):
    written = take()
    lines = motive_lines(written, bodies=1)
    first = next(k for k, line in enumerate(lines) if line.startswith("Frame")) + 1
    cells = lines[first + 5].split(",")
    cells[2:9] = 7 * [""]
    lines[first + 5] = ",".join(cells)
    found = read_motive_csv(write_lines(lines, tmp_path / "a.csv"))
    assert np.isnan(found.positions[5, 0]).all()
    np.testing.assert_array_equal(found.orientations[5, 0], found.orientations[4, 0])


def test_other_frames_than_the_first_line_counts(tmp_path):
    lines = motive_lines(take())
    with pytest.warns(RecordingWarning, match="Total Exported Frames is 20 and 15 frames follow"):
        read_motive_csv(write_lines(lines[:-5], tmp_path / "a.csv"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: [lines[0].replace("Global", "Local"), *lines[1:]], "Coordinate Space is 'Local'; expected Global"),
        (lambda lines: lines[:3], "no line of columns that begins with Frame"),
        (lambda lines: lines[:7], "no frames after the header"),
        (lambda lines: [*lines[:6], "Frame,Time" + 9 * ",Q", *lines[7:]], "no columns of positions"),
        (lambda lines: [], "the file is empty; expected a Motive CSV"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, change, message):
    path = write_lines(change(motive_lines(take())), tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=message) as caught:
        read_motive_csv(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "called", ["Unlabeled 1001", "Unlabeled:1001", "Unlabeled_1001", "Active 3"]
)
def test_what_motive_did_not_label_has_no_name(tmp_path, called):
    written = take(("a", "b", None))
    lines = [line.replace("Unlabeled 1002", called) for line in motive_lines(written)]
    assert_reads(lines, written, tmp_path)


def test_a_comma_in_a_name(tmp_path):
    written = take(("Hand, left", "Hand, right", "c"))
    assert_reads(motive_lines(written, bodies=1), written, tmp_path)
