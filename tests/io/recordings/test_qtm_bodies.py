import numpy as np
import pytest
from foreign_recordings import six_d_lines, write_lines
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording
from besman.io.recordings.qtm_bodies import has_bodies
from besman.io.recordings.text_lines import TextLines
from besman.records import Recording

RNG = np.random.default_rng(0)


def take(names=("Hand", "Back top"), n_samples=12, first_frame=5):
    time = (first_frame - 1 + np.arange(n_samples)) / 100
    positions = RNG.normal(scale=0.3, size=(1, len(names), 3)) + 0.1 * np.sin(time)[:, None, None]
    positions[3:5, 1] = np.nan
    turns = Rotation.random(n_samples * len(names), rng=1).as_quat(scalar_first=True)
    return Recording(
        time, positions, names, 100.0, "a", first_frame, turns.reshape(n_samples, -1, 4)
    )


def assert_reads(lines, written, tmp_path):
    found = read_recording(write_lines(lines, tmp_path / "a.tsv", "\r\n"))
    np.testing.assert_allclose(found.positions, written.positions, atol=1e-8)
    np.testing.assert_allclose(found.time, written.time, atol=1e-6)
    assert (found.names, found.rate_hz) == (written.names, 100.0)
    seen = np.isfinite(written.positions[..., 0])
    turns = [
        Rotation.from_quat(one.orientations[seen], scalar_first=True) for one in (found, written)
    ]
    np.testing.assert_allclose((turns[0].inv() * turns[1]).magnitude(), 0, atol=1e-5)
    assert np.isfinite(found.orientations).all()
    return found


@pytest.mark.parametrize("cells", ["with", "without", "joined"])
@pytest.mark.parametrize("order", [("Yaw", "Pitch", "Roll"), ("Roll", "Pitch", "Yaw")])
def test_bodies_of_every_header(tmp_path, cells, order):
    written = take()
    found = assert_reads(six_d_lines(written, cells, order), written, tmp_path)
    assert found.first_frame == 5
    # Over a gap a body is turned as it was last.
    np.testing.assert_array_equal(found.orientations[3:5, 1], found.orientations[[2, 2], 1])


def test_no_line_of_columns(tmp_path):
    written = take(first_frame=1)
    assert_reads(six_d_lines(written, "without", columns=False), written, tmp_path)


@pytest.mark.parametrize("word", ["NA", "NaN", "null"])
def test_words_for_gaps_and_residuals(tmp_path, word):
    written = take()
    lines = [line.replace("\t\t", f"\t{word}\t").replace("\t\t", f"\t{word}\t") for line in six_d_lines(written, "joined")]  # noqa: E501  # fmt: skip
    assert_reads(
        [line + word if line.endswith("\t") else line for line in lines], written, tmp_path
    )
    lines = six_d_lines(written, "joined")
    cells = lines[-1].split("\t")
    cells[2 + 6] = "-1.000000"
    lines[-1] = "\t".join(cells)
    found = read_recording(write_lines(lines, tmp_path / "b.tsv"))
    assert np.isnan(found.positions[-1, 0]).all()


def test_segments_of_a_skeleton(tmp_path):
    written = take(("Hips", "Spine"))
    rows = []
    for at in range(len(written.time)):
        cells = [str(5 + at), f"{written.time[at]:.5f}"]
        for k in range(2):
            w, x, y, z = written.orientations[at, k]
            place = 1000 * written.positions[at, k]
            cells += [f"{one:.6f}" for one in (*place, x, y, z, w)]
        rows.append("\t".join(cells).replace("nan", ""))
    names = [f"{name} {axis}" for name in written.names for axis in ("X", "Y", "Z", "QX", "QY", "QZ", "QW")]  # noqa: E501  # fmt: skip
    head = [
        "NO_OF_FRAMES\t12",
        "FREQUENCY\t100",
        "SKELETON\tP1",
        "\t".join(["Frame", "Time", *names]),
    ]
    assert_reads([*head, *rows], written, tmp_path)


def test_na_in_cells_of_markers(tmp_path):
    lines = ["NO_OF_FRAMES\t3", "FREQUENCY\t100", "MARKER_NAMES\ta\tb",
             "1\t2\t3\tNA\tNA\tNA", "1\t2\t3\t4\t5\t6", "NA\tNA\tNA\t4\t5\t6"]  # fmt: skip
    found = read_recording(write_lines(lines, tmp_path / "a.tsv"))
    assert np.isnan(found.positions[..., 0]).tolist() == [
        [False, True],
        [False, False],
        [True, False],
    ]
    # Beside a cell that is not plain, too.
    lines[4] = lines[4].replace("2", " 2 ")
    again = read_recording(write_lines(lines, tmp_path / "b.tsv"))
    np.testing.assert_array_equal(again.positions, found.positions)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: lines[:5], "no frames after the header"),
        (
            lambda lines: ["NO_OF_BODIES\t0", "FREQUENCY\t100", "1\t2\t3"],
            "no bodies with X, Y and Z",
        ),
        (
            lambda lines: ["NO_OF_BODIES\t1", "FREQUENCY\t100", "a X\taY\tZ", "1\t2\t3"],
            "no bodies with X, Y and Z",
        ),
        (
            lambda lines: lines[:-2],
            r"NO_OF_FRAMES is 12 and 10 .*is the file cut\? --partial takes",
        ),
        (lambda lines: [*lines[:-1], lines[-1] + "\t1\t2\t3"], "columns, expected"),
        (
            lambda lines: ["NO_OF_FRAMES\t1_2", *lines[1:]],
            "NO_OF_FRAMES is '1_2'; expected a whole number",
        ),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, change, message):
    path = write_lines(change(six_d_lines(take())), tmp_path / "a.tsv")
    with pytest.raises(RecordingError, match=message):
        read_recording(path)


@pytest.mark.parametrize("entry", ["1e308", "1.2", "-1", "7"])
def test_a_matrix_that_is_no_rotation_is_left_out_in_words(tmp_path, entry):
    lines = six_d_lines(take())
    rows = [k for k, line in enumerate(lines) if line.startswith("7\t")]
    cells = lines[rows[0]].split("\t")
    cells[10] = entry
    lines[rows[0]] = "\t".join(cells)
    with pytest.warns(RecordingWarning, match="1 orientations of 'Hand' are no rotations"):
        found = read_recording(write_lines(lines, tmp_path / "a.tsv"))
    # As it was last.
    np.testing.assert_array_equal(found.orientations[2, 0], found.orientations[1, 0])


def test_a_rate_that_is_no_number_is_said(tmp_path):
    lines = [line.replace("FREQUENCY\t100", "FREQUENCY\t1_00") for line in six_d_lines(take())]
    with pytest.warns(RecordingWarning, match="no number where the rate stands; 100, as the times"):
        assert read_recording(write_lines(lines, tmp_path / "a.tsv")).rate_hz == 100.0


def test_more_frames_than_are_said(tmp_path):
    lines = ["NO_OF_FRAMES\t10", *six_d_lines(take())[1:]]
    with pytest.warns(RecordingWarning, match="NO_OF_FRAMES is 10 and 12 frames follow"):
        read_recording(write_lines(lines, tmp_path / "a.tsv"))


def test_markers_are_no_bodies():
    for text, expected in (
        ("NO_OF_BODIES\t1\n", True),
        ("DATA_INCLUDED\t6D\n", True),
        ("DATA_INCLUDED\t3D\nMARKER_NAMES\ta\n", False),
        ("MARKER_NAMES\ta\nNO_OF_BODIES\t0\n", False),
    ):
        assert has_bodies(TextLines(lambda first, text=text: [text.encode()[first:]])) == expected
