# ruff: noqa: E501
import numpy as np
import pytest
from foreign_recordings import nexus_lines, write_lines
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording, recognise
from besman.io.recordings.nexus_csv import read_nexus_csv
from besman.records import Recording

RNG = np.random.default_rng(0)


def take(names=("LASI", None, "RASI"), first_frame=7, n_samples=20):
    time = (first_frame - 1 + np.arange(n_samples)) / 50
    positions = RNG.normal([0, 0, 1], 0.3, size=(1, len(names), 3))
    positions = positions + 0.1 * np.sin(time)[:, None, None]
    positions[4:6, 1] = positions[-3:, -1] = np.nan
    return Recording(time, positions, names, 50.0, "a.csv", first_frame)


def assert_reads(lines, written, tmp_path, end="\r\n", **options):
    found = read_nexus_csv(write_lines(lines, tmp_path / "a.csv", end), **options)
    np.testing.assert_allclose(found.positions, written.positions, atol=1e-8)
    np.testing.assert_allclose(found.time, written.time, atol=1e-9)
    assert (found.names, found.rate_hz) == (written.names, written.rate_hz)
    assert found.first_frame == written.first_frame
    return found


@pytest.mark.parametrize("commas", [0, 40])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_trajectories(tmp_path, commas, end):
    written = take()
    assert_reads(nexus_lines(written, commas=commas), written, tmp_path, end)


@pytest.mark.parametrize("sep", [";", "\t"])
def test_other_separators(tmp_path, sep):
    written = take()
    lines = [line.replace(",", sep) for line in nexus_lines(written)]
    assert_reads(lines, written, tmp_path)
    # The first row may have no number with decimals.
    german = [*lines[:5], *(line.replace(".", ",") for line in lines[5:])]
    german[5] = german[5].replace(",000000", "")
    assert_reads(german, written, tmp_path)


def test_several_subjects_keep_their_names(tmp_path):
    written = take(("S1:LASI", "S2:LASI", "S2:RASI"))
    assert_reads(nexus_lines(written, subject=""), written, tmp_path)


def test_workstation(tmp_path):
    written = take()
    lines = nexus_lines(written, "TRAJECTORIES", first="Field #", units=False, rate="50,Hz")
    path = write_lines(lines, tmp_path / "w.csv")
    with pytest.warns(RecordingWarning, match="the line of units is empty; .* taken for mm"):
        assert_reads(lines, written, tmp_path)
    with pytest.warns(RecordingWarning):
        assert read_recording(path).origin.format == "Nexus CSV"
    assert_reads(lines, written, tmp_path, units="mm")


def test_tables_before_and_behind(tmp_path):
    written = take()
    devices = ["Devices", "1000", ",,Force", "Frame,Sub Frame,Fx,Fy,Fz", ",,N,N,N", "1,0,1,2,3", ""]
    outputs = ["", "Model Outputs", "50", ",,S1:Angle", "Frame,Sub Frame,X,Y,Z", ",,deg,deg,deg", "1,0,1,2,3"]  # fmt: skip
    found = assert_reads([*devices, *nexus_lines(written), *outputs], written, tmp_path)
    assert found.origin.notes == ("taken from trajectories; not looked at: devices, model outputs",)


def test_positions_among_model_outputs(tmp_path):
    written = take(("CentreOfMass", "HED", "x"))
    lines = nexus_lines(written, "Model Outputs")
    # Angles in front, a body's angles before its place, forces behind.
    lines[2] = ",,S1:Angle,,,S1:CentreOfMass,,,S1:HED,,,,,,S1:x,,,S1:Force,,"
    lines[3] = "Frame,Sub Frame,X,Y,Z,X,Y,Z,RX,RY,RZ,TX,TY,TZ,X,Y,Z,X,Y,Z"
    lines[4] = ",,deg,deg,deg,mm,mm,mm,deg,deg,deg,mm,mm,mm,mm,mm,mm,N,N,N"
    for k, line in enumerate(lines[5:], start=5):
        cells = line.split(",")
        lines[k] = ",".join([*cells[:2], *"123", *cells[2:5], *"456", *cells[5:], *"789"])
    assert_reads(lines, written, tmp_path)


def test_sub_frames_count(tmp_path):
    written = take(first_frame=1)
    lines = nexus_lines(written, rate="50")
    rows = [line.split(",", 2)[2] for line in lines[5:]]
    subs = [f"{k // 4 + 1},{k % 4},{row}" for k, row in enumerate(rows)]
    assert_reads([*lines[:5], *subs], written, tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: ["Events", "50", "x"], "no table of trajectories or model outputs; got events"),
        (lambda lines: ["Nothing"], "no table of trajectories or model outputs; got none"),
        (lambda lines: lines[:3], "no line of columns that begins with Frame below 'trajectories'"),
        (lambda lines: [*lines[:4], lines[4].replace("mm", "deg"), *lines[5:]], "no columns of positions in 'trajectories'"),
        (lambda lines: lines[:5], "no frames after the header"),
        (lambda lines: [lines[0], "0", *lines[2:]], "the header has 0 frames a second, and no times"),
        (lambda lines: [*lines[:6], "7,0,1", *lines[7:]], "frame 7 follows frame 7; expected frames that rise"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, change, message):
    path = write_lines(change(nexus_lines(take())), tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=message) as caught:
        read_nexus_csv(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("rate", [["50"], []])
def test_events_first(tmp_path, rate):
    written = take()
    events = [
        "Events",
        *rate,
        "Subject,Context,Name,Time (s),Description",
        "S1,Left,Foot Off,0.2,the toe",
        "",
    ]
    lines = [*events, *nexus_lines(written)]
    assert_reads(lines, written, tmp_path)
    path = write_lines(lines, tmp_path / "b.csv")
    assert read_recording(path).origin.notes == ("taken from trajectories; not looked at: events",)


@pytest.mark.parametrize("is_turn_first", [True, False])
@pytest.mark.parametrize("called", ["Global Angle (Quaternion) {0}:{0}", "{0}:{0}", "{0}"])
def test_objects_have_places_and_quaternions(tmp_path, called, is_turn_first):
    written = take(("hand", "box"), first_frame=1)
    turns = Rotation.random(len(written.time), rng=0).as_quat(canonical=True)
    head, axes, unit = [",,"], ["RX,RY,RZ,RW", "TX,TY,TZ"], [",,,", "mm,mm,mm"]
    if not is_turn_first:
        axes, unit = axes[::-1], unit[::-1]
    head += [called.format(name) + 7 * "," for name in written.names]
    lines = [
        "Objects",
        "50",
        "".join(head),
        ",".join(["Frame,Sub Frame", *axes, *axes]),
        ",," + ",".join(unit + unit),
    ]
    for k, row in enumerate(written.positions):
        cells = []
        for place in row:
            parts = [
                ",".join(f"{one:.9f}" for one in turns[k]),
                ",".join("" if np.isnan(one) else f"{1000 * one:.6f}" for one in place),
            ]
            cells += parts if is_turn_first else parts[::-1]
        lines.append(",".join([str(k + 1), "0", *cells]))
    found = assert_reads(lines, written, tmp_path)
    assert recognise(write_lines(lines, tmp_path / "o.csv").read_bytes()).name == "Nexus CSV"
    for body in range(2):
        np.testing.assert_allclose(found.orientations[:, body], turns[:, [3, 0, 1, 2]], atol=1e-8)
