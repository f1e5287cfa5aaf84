# ruff: noqa: E501
import os
import struct
import warnings
from pathlib import Path

import ezc3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.c3d import read_c3d, write_c3d
from besman.records import Recording

REAL = Path(
    os.environ.get("BESMAN_REAL_DATA", Path(__file__).parents[3].parent / "shared" / "data")
)
RNG = np.random.default_rng(0)


def record(names=("a", "b", "c"), n_samples=20, first_frame=1, rate_hz=100.0):
    positions = RNG.normal(size=(n_samples, len(names), 3))
    positions[3:6, -1] = np.nan
    time = (first_frame - 1 + np.arange(n_samples)) / rate_hz
    return Recording(time, positions, names, rate_hz, "trip.c3d", first_frame)


def foreign(path, points_mm, labels, units="mm", residuals=None, extra=None):
    """Write a file as another program would."""
    file = ezc3d.c3d()
    points = file["parameters"]["POINT"]
    points["RATE"]["value"] = [100.0]
    points["LABELS"]["value"] = list(labels)
    points["UNITS"]["value"] = [] if units is None else [units]
    for name, value in (extra or {}).items():
        file.add_parameter("POINT", name, value)
    coordinates = np.ones((4, points_mm.shape[1], points_mm.shape[0]))
    coordinates[:3] = points_mm.transpose(2, 1, 0)
    file["data"]["points"] = coordinates
    if residuals is not None:
        file["data"]["meta_points"] = {
            "residuals": residuals.T[None],
            "camera_masks": np.zeros((7, *coordinates.shape[1:]), dtype=bool),
        }
    file.write(str(path))
    return path


@settings(max_examples=25, deadline=None)
@given(
    positions=npst.arrays(
        np.float64,
        st.tuples(st.integers(1, 12), st.integers(1, 4), st.just(3)),
        elements=st.floats(-9, 9, width=32),
    ),
    gaps=npst.arrays(np.bool_, (12, 4)),
    first_frame=st.integers(1, 5000),
    rate_hz=st.sampled_from([60.0, 59.94, 500.0]),
)
def test_round_trip(tmp_path_factory, positions, gaps, first_frame, rate_hz):
    n_samples, n_points = positions.shape[:2]
    positions = np.where(gaps[:n_samples, :n_points, None], np.nan, positions)
    names = ("Hand top", None, "Ü", None)[:n_points]
    time = (first_frame - 1 + np.arange(n_samples)) / rate_hz
    recording = Recording(time, positions, names, rate_hz, "trip.c3d", first_frame)
    path = tmp_path_factory.mktemp("trip") / "trip.c3d"
    write_c3d(recording, path)
    again = read_c3d(path)
    np.testing.assert_allclose(again.positions, positions, atol=1e-6, rtol=0)
    np.testing.assert_array_equal(again.time, time)
    assert (again.names, again.rate_hz, again.source, again.first_frame) == (
        names,
        rate_hz,
        "trip.c3d",
        first_frame,
    )


def test_same_recording_same_bytes(tmp_path):
    recording = record()
    for name in ("a.c3d", "b.c3d"):
        write_c3d(recording, tmp_path / name)
    assert (tmp_path / "a.c3d").read_bytes() == (tmp_path / "b.c3d").read_bytes()


def test_gaps_are_written_as_residuals(tmp_path):
    recording = record()
    write_c3d(recording, tmp_path / "a.c3d")
    content = (tmp_path / "a.c3d").read_bytes()
    start = (struct.unpack_from("<H", content, 16)[0] - 1) * 512
    values = np.frombuffer(content[start : start + 20 * 3 * 16], "<f4").reshape(20, 3, 4)
    assert np.isfinite(values).all()
    np.testing.assert_array_equal(values[..., 3] == -1, np.isnan(recording.positions[..., 0]))


def test_more_than_255_points(tmp_path):
    recording = record(tuple(f"m{index}" for index in range(600)), n_samples=4)
    write_c3d(recording, tmp_path / "a.c3d")
    again = read_c3d(tmp_path / "a.c3d")
    assert again.names == recording.names
    np.testing.assert_allclose(again.positions, recording.positions, atol=1e-6)


def test_too_many_frames_for_the_format(tmp_path):
    with pytest.raises(RecordingError, match=r"frames up to 65536; C3D counts .* write \.tsv"):
        write_c3d(record(("a",), n_samples=65_536), tmp_path / "a.c3d")
    with pytest.raises(RecordingError, match="frames up to 65546; C3D counts up to 65535"):
        write_c3d(record(("a",), first_frame=65_527), tmp_path / "a.c3d")
    assert not list(tmp_path.iterdir())
    write_c3d(record(("a",), n_samples=65_535), tmp_path / "a.c3d")
    content = bytearray((tmp_path / "a.c3d").read_bytes())
    assert len(read_c3d(tmp_path / "a.c3d").time) == 65_535
    # A recording of 70 000 frames, whose last frame was counted modulo 65 536.
    struct.pack_into("<H", content, 8, 70_000 - 65_536)
    (tmp_path / "a.c3d").write_bytes(bytes(content) + bytes(16 * (70_000 - 65_535)))
    with pytest.raises(RecordingError, match=r"got about 7000\d frames; C3D counts up to 65535"):
        read_c3d(tmp_path / "a.c3d")


def test_folder_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="cannot be written"):
        write_c3d(record(), tmp_path / "absent" / "a.c3d")


@pytest.mark.parametrize(
    ("units", "scale"), [("mm", 1e-3), ("m", 1.0), ("MM", 1e-3), ("Meters", 1.0)]
)
def test_units(tmp_path, units, scale):
    points = RNG.normal(size=(5, 2, 3)).astype(np.float32)
    recording = read_c3d(foreign(tmp_path / "a.c3d", points, "ab", units))
    np.testing.assert_allclose(recording.positions, points * scale, rtol=1e-6)


def test_units_that_cannot_be_told(tmp_path):
    points = RNG.normal(size=(5, 2, 3)) * 0.01
    path = foreign(tmp_path / "a.c3d", points, "ab", units=None)
    with pytest.raises(RecordingError, match=r"POINT:UNITS is empty .* cannot be told"):
        read_c3d(path)
    recording = read_c3d(path, "m")
    np.testing.assert_allclose(recording.positions, points, atol=1e-6)
    assert (recording.origin.units, recording.origin.units_by) == ("m", "asked for")
    path = foreign(tmp_path / "b.c3d", points, "ab", units="furlong")
    with pytest.raises(RecordingError, match=r"UNITS is 'furlong' .* expected 'mm', 'cm' or 'm'"):
        read_c3d(path)
    path = foreign(tmp_path / "c.c3d", np.full((5, 1, 3), 1000.0), "a", units=None)
    with pytest.raises(RecordingError, match="cannot be told"):
        read_c3d(path)
    with pytest.raises(RecordingError, match="cannot be told"):
        read_c3d(foreign(tmp_path / "d.c3d", np.full((5, 1, 3), np.nan), "a", units=None))


@pytest.mark.parametrize(("units", "scale"), [("mm", 1000), ("cm", 100), ("m", 1)])
def test_the_size_of_a_person_tells_the_units(tmp_path, units, scale):
    points = RNG.uniform(-0.8, 0.8, size=(5, 20, 3))
    path = foreign(tmp_path / "a.c3d", points * scale, "abcdefghijklmnopqrst", units=None)
    with pytest.warns(RecordingWarning, match=rf"a.c3d: POINT:UNITS is empty; .* for {units}, by"):
        recording = read_c3d(path)
    np.testing.assert_allclose(recording.positions, points, atol=1e-6)
    assert recording.origin.units_by == "the size of a person"


def test_what_is_asked_for_counts_more_than_the_file(tmp_path):
    points = RNG.normal(size=(5, 2, 3))
    path = foreign(tmp_path / "a.c3d", points, "ab", units="mm")
    with pytest.warns(RecordingWarning, match=r"UNITS is 'mm' and the units asked for are m"):
        recording = read_c3d(path, "m")
    np.testing.assert_allclose(recording.positions, points, atol=1e-6)


def test_names(tmp_path):
    points = RNG.normal(size=(3, 4, 3))
    labels = ["subject:LASI", "subject:*12", " ", "*3"]
    recording = read_c3d(foreign(tmp_path / "a.c3d", points, labels))
    assert recording.names == ("LASI", None, None, None)
    labels = ["one:LASI", "two:LASI", "box", "two:*1"]
    recording = read_c3d(foreign(tmp_path / "a.c3d", points, labels))
    assert recording.names[:3] == ("one:LASI", "two:LASI", "box")


@pytest.mark.parametrize(
    ("labels", "kept"),
    [(["a", "b", "a"], (None, "b", None)), (["s:a", "b", "a"], (None, "b", None))],
)
def test_two_points_with_one_name_have_none(tmp_path, labels, kept):
    path = foreign(tmp_path / "a.c3d", RNG.normal(size=(3, 3, 3)), labels)
    with pytest.warns(RecordingWarning, match=r"several points have one name .* 'a' \(2\)"):
        assert read_c3d(path).names == kept


def test_the_only_one_of_a_name_that_is_seen_keeps_it(tmp_path):
    points = RNG.normal(size=(3, 3, 3))
    points[:, 2] = np.nan
    assert read_c3d(foreign(tmp_path / "a.c3d", points, ["a", "b", "a"])).names == ("a", "b", None)


@pytest.mark.parametrize(
    ("labels", "descriptions", "names"),
    [
        (["BACK", "BACK", "HAND"], ["back_top", "back_left", "hand"], ("back_top", "back_left", "hand")),
        (["SHOU", "ELBO", "C7"], ["Shoulder", "Elbow", "C7"], ("Shoulder", "Elbow", "C7")),
        # What a label is short for is not its name.
        (["LASI", "RASI", "C7"], ["Left front pelvis", "Right front pelvis", "C7"], ("LASI", "RASI", "C7")),
        (["LASI", "RASI", "C7"], ["", "", ""], ("LASI", "RASI", "C7")),
        (["elbow", "hand", "back"], ["elbow", "hand", "back"], ("elbow", "hand", "back")),
    ],
)  # fmt: skip
def test_descriptions_are_names_where_labels_are_cut(tmp_path, labels, descriptions, names):
    extra = {"DESCRIPTIONS": descriptions}
    path = foreign(tmp_path / "a.c3d", RNG.normal(size=(3, 3, 3)), labels, extra=extra)
    assert read_c3d(path).names == names


@pytest.mark.parametrize(
    ("screen", "up"),
    [(("+X", "+Z"), "z"), (("+X", "+Y"), "y"), (("+Z", "-y"), "-y"), (("+X", "+X"), None), (("", ""), None)],
)  # fmt: skip
def test_the_screen_says_which_way_is_up(tmp_path, screen, up):
    extra = {key: [value] for key, value in zip(("X_SCREEN", "Y_SCREEN"), screen, strict=True)}
    path = foreign(tmp_path / "a.c3d", RNG.normal(size=(3, 2, 3)), "ab", extra=extra)
    origin = read_c3d(path).origin
    assert (origin.up, bool(origin.up_by)) == (up or "z", up is not None)


def test_events_and_the_writer_are_kept_as_notes(tmp_path):
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["LABELS"]["value"] = ["a"]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file.add_parameter("EVENT", "LABELS", ["Foot Strike", "Foot Off"])
    file.add_parameter("EVENT", "CONTEXTS", ["Left", "Right"])
    file.add_parameter("EVENT", "TIMES", np.array([[0.0, 1.0], [1.25, 2.5]]))
    file.add_parameter("MANUFACTURER", "SOFTWARE", ["Nexus"])
    file["data"]["points"] = np.ones((4, 1, 3))
    file.write(str(tmp_path / "a.c3d"))
    origin = read_c3d(tmp_path / "a.c3d").origin
    assert origin.notes == ("events: Left Foot Strike 1.250 s, Right Foot Off 62.500 s",)
    assert origin.writer == "Nexus"


def test_angles_are_no_positions(tmp_path):
    points = RNG.normal(size=(3, 3, 3))
    path = foreign(tmp_path / "a.c3d", points, ["a", "Knee", "b"], extra={"ANGLES": ["Knee"]})
    recording = read_c3d(path)
    assert recording.names == ("a", "b")
    assert recording.origin.notes == (
        "1 point is no position but angles, forces or other outputs of a model, and left out",
    )
    np.testing.assert_allclose(recording.positions, points[:, [0, 2]] / 1000, atol=1e-6)
    path = foreign(tmp_path / "b.c3d", points, "abc", extra={"FORCES": ["a", "b", "c"]})
    with pytest.raises(RecordingError, match="no points that are positions"):
        read_c3d(path)


def test_what_a_users_model_gives_is_no_position_unless_it_says_so(tmp_path):
    names = ["a", *(f"USERMO{k}" for k in range(14))]
    kinds = {f"USERMO{k}": [f"Modeled Angles:{axis}:Angle" for axis in "xyz"] for k in range(14)}
    kinds["USERMO1"] = [f"Modeled Forces:{axis}:Force" for axis in "xyz"]
    kinds["USERMO12"] = [f"Modeled Markers:{axis}:Length" for axis in "xyz"]
    points = RNG.normal(size=(3, len(names), 3))
    path = foreign(tmp_path / "a.c3d", points, names, extra={"USERMOS": names[1:], **kinds})
    recording = read_c3d(path)
    assert recording.names == ("a", "USERMO12")
    np.testing.assert_allclose(recording.positions, points[:, [0, 13]] / 1000, atol=1e-6)
    assert recording.origin.notes[0].startswith("13 points are no positions")


def test_a_bare_nan_is_a_gap(tmp_path):
    points = RNG.normal(size=(6, 2, 3))
    points[2, 0] = np.nan
    residuals = np.zeros((6, 2))
    residuals[4, 1] = -1
    recording = read_c3d(foreign(tmp_path / "a.c3d", points, "ab", residuals=residuals))
    gaps = np.isnan(recording.positions).all(axis=2)
    assert np.argwhere(gaps).tolist() == [[2, 0], [4, 1]]


def make_c3d(processor, is_float):
    """Write the smallest file of a processor by hand: one point, two frames, no parameters."""
    order = ">" if processor == 86 else "<"

    def number(value):
        data = struct.pack(f"{order}f", value)
        if processor == 85:
            data = struct.pack("<f", value * 4)
            data = data[2:] + data[:2]
        return data

    rows = [(1.0, 2.0, 3.0, 0.0), (-4.0, 5.5, 6.0, -1.0)]
    header = bytes([2, 0x50]) + struct.pack(f"{order}5H", 1, 0, 7, 8, 10)
    header += number(-1.0 if is_float else 0.5) + struct.pack(f"{order}2H", 3, 0) + number(60.0)
    group = bytes([5, 255]) + b"POINT" + struct.pack(f"{order}H", 3) + b"\0"
    units = bytes([5, 1]) + b"UNITS" + struct.pack(f"{order}H", 0) + bytes([255, 1, 2]) + b"mm\0"
    parameters = bytes([1, 0x50, 1, processor]) + group + units
    if is_float:
        data = b"".join(number(value) for row in rows for value in row)
    else:
        data = b"".join(
            struct.pack(f"{order}4h", *(int(value * 2) for value in row[:3]), int(row[3]))
            for row in rows
        )
    return header.ljust(512, b"\0") + parameters.ljust(512, b"\0") + data.ljust(512, b"\0")


@pytest.mark.parametrize("is_float", [True, False])
@pytest.mark.parametrize("processor", [84, 85, 86])
def test_processors(tmp_path, processor, is_float):
    path = tmp_path / "a.c3d"
    path.write_bytes(make_c3d(processor, is_float))
    recording = read_c3d(path)
    np.testing.assert_allclose(recording.positions[0, 0], [0.001, 0.002, 0.003])
    assert np.isnan(recording.positions[1]).all()
    assert (recording.rate_hz, recording.first_frame, recording.names) == (60, 7, (None,))


def patched(at, value):
    return lambda content: content[:at] + value + content[at + len(value) :]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content[:100], "no C3D header; .* got 100 bytes; is the file cut"),
        (lambda content: content[:512], "ends before its parameters; is it cut"),
        (lambda content: content[:530], "parameter at byte .* cannot be read; is the file cut"),
        (lambda content: content[:-700], r"ends after \d+ of 20 frames; is it cut"),
        (patched(1, b"Q"), "no C3D header"),
        (patched(515, b"\x07"), "byte order 7 is unknown"),
        (patched(2, b"\x02\0"), "header counts 2 points and POINT:USED"),
        (patched(2, b"\0\0"), "header counts no points"),
        (patched(6, b"\x09\0\x02\0"), "frames 9 to 2; expected frames that count up"),
        (patched(12, struct.pack("<f", np.nan)), "scale in the header is nan"),
        (lambda content: content.replace(struct.pack("<f", 100), b"\0\0\0\0"), "POINT:RATE is 0"),
        (lambda content: content.replace(b"RATE", b"RATY"), ""),
    ],
)
def test_damaged_files(tmp_path, change, message):
    path = tmp_path / "a.c3d"
    write_c3d(record(), path)
    path.write_bytes(change(path.read_bytes()))
    if not message:
        assert read_c3d(path).rate_hz == 100
        return
    with pytest.raises(RecordingError, match=message) as caught:
        read_c3d(path)
    assert "\n" not in str(caught.value)


def test_frames_may_count_from_0(tmp_path):
    one, zero = tmp_path / "one.c3d", tmp_path / "zero.c3d"
    write_c3d(record(), one)
    content = one.read_bytes()
    zero.write_bytes(content[:6] + struct.pack("<2H", 0, 19) + content[10:])
    expected, found = read_c3d(one), read_c3d(zero)
    assert (expected.first_frame, found.first_frame) == (1, 0)
    np.testing.assert_array_equal(found.time, expected.time)
    np.testing.assert_array_equal(found.positions, expected.positions)
    write_c3d(found, zero)
    assert zero.read_bytes() == content


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"absent.c3d: no such file"):
        read_c3d(tmp_path / "absent.c3d")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_c3d(tmp_path)


@settings(max_examples=300, deadline=None)
@given(
    changes=st.lists(st.tuples(st.integers(0, 1700), st.integers(0, 255)), min_size=1, max_size=4),
    length=st.one_of(st.none(), st.integers(0, 3000)),
)
def test_damage_ends_in_one_line(tmp_path_factory, changes, length):
    folder = tmp_path_factory.getbasetemp()
    path = folder / "damaged.c3d"
    if not (folder / "whole.c3d").exists():
        write_c3d(record(), folder / "whole.c3d")
    content = bytearray((folder / "whole.c3d").read_bytes())
    for at, value in changes:
        content[at] = value
    path.write_bytes(content[:length])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordingWarning)
        try:
            read_c3d(path)
        except RecordingError as error:
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not on this machine")
@pytest.mark.parametrize(
    ("name", "n_points", "n_frames", "n_named"),
    [("KneeltoProne01.c3d", 62, 1745, 62), ("S09_KneeltoRun02.c3d", 75, 1479, 0)],
)
def test_real_recordings_beside_a_second_library(tmp_path, name, n_points, n_frames, n_named):
    path = REAL / "c3d" / name
    with pytest.warns(RecordingWarning, match="taken for mm"):
        recording = read_c3d(path)
    assert recording.positions.shape == (n_frames, n_points, 3)
    assert sum(name is not None for name in recording.names) == n_named
    assert recording.rate_hz == 240
    expected = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0) / 1000
    np.testing.assert_allclose(recording.positions, expected, rtol=1e-12)
    write_c3d(recording, tmp_path / "again.c3d")
    again = read_c3d(tmp_path / "again.c3d")
    np.testing.assert_allclose(again.positions, expected, rtol=1e-7)
    assert again.names == recording.names
