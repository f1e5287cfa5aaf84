import json
import shlex
import warnings
from pathlib import Path

import numpy as np
import pytest
from command_line import besman
from foreign_recordings import bvh_lines
from one_frame_files import write_panoptic
from places import SAMPLE, TOP

from besman.exceptions import RecordingError
from besman.io.recordings.format import reading
from besman.io.recordings.formats import FORMATS, read_recording, write_recording
from besman.io.segments_json import segments_path
from besman.records import Recording
from besman.standalone.look_files import content_of, look_at, look_at_all, measure_extent
from besman.standalone.look_text import describe_look, find_next, find_next_of_all
from besman.synthetic.free_throw import simulate_free_throw

NAMED = SAMPLE / "subject1.tsv"


def write(path, names, positions, rate_hz=100.0):
    time = np.arange(len(positions)) / rate_hz
    write_recording(Recording(time, positions, tuple(names), rate_hz, path.name), path)
    return path


def walk(n, n_markers, seed=0):
    """Markers that wander a little, a metre and more above the floor."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(scale=0.002, size=(n, n_markers, 3))
    return 1.2 + rng.normal(scale=0.3, size=(n_markers, 3)) + np.cumsum(steps, axis=0)


def test_what_is_measured_of_a_trajectory(tmp_path):
    t = np.arange(200) / 100.0
    positions = walk(200, 2)
    positions[:, 0] = np.stack([2.0 * t, 0 * t, 1 + 0 * t], axis=1)  # 2 m/s along x
    positions[40:60, 1] = positions[80:85, 1] = np.nan
    look = look_at(write(tmp_path / "a.tsv", ("runner", "other"), positions))
    first, second = look.trajectories
    assert first["name"] == "runner"
    assert first["greatest_speed_m_s"] == pytest.approx(2.0)
    assert first["span_m"] == pytest.approx(3.98)
    assert first["path_m"] == pytest.approx(3.8)  # whole tenths of a second
    assert (second["gaps"], second["longest_gap_s"]) == (2, pytest.approx(0.2))
    assert second["seen_share"] == pytest.approx(175 / 200)


def test_the_extent_leaves_single_samples_out():
    positions = np.random.default_rng(0).random((500, 4, 3)) * [1.0, 2.0, 0.5]
    positions[0, 0] = 90.0
    np.testing.assert_allclose(measure_extent(positions), [1.0, 2.0, 0.5], atol=0.03)
    assert np.isnan(measure_extent(np.full((3, 2, 3), np.nan))).all()


def test_a_page_on_a_recording_of_the_sample():
    look = look_at(NAMED)
    commands = find_next(look, [])
    text = "\n".join(describe_look(look, commands))
    recording = read_recording(NAMED)
    for said in (
        "format      Qualisys TSV",
        f"time        {recording.rate_hz:g} Hz, {len(recording.time)} frames",
        "units       mm, by the format",
        "up          z, by",
        f"names       {len(recording.names)}: ",
        "gaps        ",
        "movement    most by ",
        f"marker set  right_arm: {len(look.best.found)} of its 14 markers, all that it requires",
    ):
        assert said in text
    assert commands[-1].startswith(f"besman run ur5_stick_throw --set recordings={NAMED}")


def test_the_next_command_can_be_pasted(monkeypatch, tmp_path, capsys):
    folder = tmp_path / "with blank"
    folder.mkdir()
    path = folder / "a b.tsv"
    path.write_bytes(NAMED.read_bytes())
    command = find_next(look_at(path), ["--up", "z"])[0]
    assert besman(monkeypatch, *shlex.split(command)[1:]) == 0
    assert "a b" in capsys.readouterr().out


def test_gaps_that_are_too_long_are_said_and_filled_by_the_next_command(
    monkeypatch, tmp_path, capsys
):
    recording = read_recording(NAMED)
    positions = recording.positions.copy()
    positions[100:200, recording.names.index("Elbow")] = np.nan
    path = write(tmp_path / "a.tsv", recording.names, positions, recording.rate_hz)
    look = look_at(path)
    assert "marker 'elbow' is not seen in frames" in look.fault
    assert look.needed_gap_s == pytest.approx(100 / recording.rate_hz)
    assert f"but {look.fault}" in "\n".join(describe_look(look, []))
    # Not besman segment, which has no setting for so long a gap.
    annotate, check, run = find_next(look, [])
    assert annotate == f"besman annotate {path}"
    segments_path(path).write_bytes(segments_path(NAMED).read_bytes())
    labelled = find_next(look, [])
    # Its labels are those of throws of a stick.
    assert labelled == [one.replace("reach", "stick_throw") for one in (check, run)]
    run = shlex.split(labelled[0])
    assert besman(monkeypatch, *run[1:]) == 0
    settings = [one for one in run if one.startswith("label.longest_gap_s=")]
    assert float(settings[0].partition("=")[2]) > look.needed_gap_s


def test_points_of_a_body_say_what_is_assumed(tmp_path):
    names = ("LShoulder", "RShoulder", "RElbow", "RWrist")
    look = look_at(write(tmp_path / "a.tsv", names, walk(80, 4)))
    text = "\n".join(describe_look(look, find_next(look, [])))
    assert "marker set  halpe: 4 of its 24 markers, all that it requires" in text
    assert "shoulder = RShoulder" in text
    assert "assumed: the trunk is upright" in text
    assert "besman segment" in text
    assert "--markers halpe" in text
    assert "--set label.markers=halpe" in text


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_joints_turned_from_a_pose_of_their_own_are_points(tmp_path):
    """Whose axes nobody knows: joints of a BVH called as an exoskeleton's links are not these."""
    places = {"Hips": 0.9, "RightShoulder": 1.4, "RightElbow": 1.1, "RightWrist": 0.9,
              "LeftShoulder": 1.4, "LeftElbow": 1.1, "LeftWrist": 0.9, "Head": 1.7}  # fmt: skip
    sides = {"Right": -0.2, "Left": 0.2}
    positions = np.zeros((20, len(places), 3))
    for k, (name, height) in enumerate(places.items()):
        side = next((y for word, y in sides.items() if name.startswith(word)), 0.0)
        positions[:, k] = [0.0, side, height]
    path = tmp_path / "a.bvh"
    recording = Recording(np.arange(20) / 30, positions, tuple(places), 30.0, path.name)
    path.write_text("\n".join(bvh_lines(recording, scale=100.0)))
    look = look_at(path)
    assert look.recording.orientations is not None
    assert look.best.marker_set.name == "bvh_joints"
    assert not {fit.marker_set.name for fit in look.fits if fit.is_complete} & {"exoskeleton"}


def test_whose_ball_flies_goes_on_with_the_recipe_for_throws(tmp_path):
    content = simulate_free_throw(1).content
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"fps": 30, "units": "ft", "frames": content["tracking"]}))
    commands = find_next(look_at(path), [])
    assert [one.split()[1:3] for one in commands] == [
        ["segment", str(path)], ["check", "ur5_free_throw"], ["run", "ur5_free_throw"]
    ]  # fmt: skip
    # One that is carried is none to be thrown.
    for frame in content["tracking"]:
        frame["data"]["ball"] = [10.0, 1.0, 3.0]
    path.write_text(json.dumps({"fps": 30, "units": "ft", "frames": content["tracking"]}))
    assert any("annotate" in one for one in find_next(look_at(path), []))


def test_a_landing_is_said_with_the_ring_or_without(tmp_path):
    throw = simulate_free_throw(1)
    content = {**throw.content, "landing_x": throw.on_ring_in[0], "landing_y": throw.on_ring_in[1]}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    look = look_at(path)
    np.testing.assert_allclose(content_of(look, [])["landing_m"], throw.landing(3.048))
    assert any("the ring nearest on an NBA court: at" in line for line in describe_look(look, []))
    for frame in content["tracking"]:
        for point in (frame["data"]["ball"], *frame["data"]["player"].values()):
            point[0] -= 20.7
    path.write_text(json.dumps(content))
    look = look_at(path)
    assert content_of(look, [])["landing_m"] is None
    assert any("no ring of an NBA court is near" in line for line in describe_look(look, []))


def test_a_person_who_lies_is_looked_at_with_another_axis_up(tmp_path):
    recording = read_recording(NAMED)
    lying = recording.positions[:, :, [0, 2, 1]] * [1.0, 1.0, -1.0]
    path = write(tmp_path / "a.tsv", recording.names, lying, recording.rate_hz)
    with reading(up="z"):
        look = look_at(path)
    assert "upright" in look.fault
    assert find_next(look, []) == [f"besman look {path} --up y"]
    assert find_next(look, ["--up", "z"]) == [f"besman look {path} --plot a.png --up z"]


def test_names_that_are_of_no_set_or_of_a_part_of_one(tmp_path):
    some = look_at(write(tmp_path / "a.tsv", ("Elbow", "Shoulder", "x"), walk(50, 3)))
    text = "\n".join(describe_look(some, find_next(some, [])))
    assert "marker set  none fits; nearest" in text
    assert "not there: " in text
    none = look_at(write(tmp_path / "b.tsv", ("x", "y"), walk(50, 2)))
    text = "\n".join(describe_look(none, find_next(none, [])))
    assert "marker set  none: no name is known" in text
    assert f"besman markers new {tmp_path / 'b.tsv'} --out b_markers.yaml" in text
    unnamed = look_at(write(tmp_path / "c.tsv", (None, None), walk(50, 2)))
    text = "\n".join(describe_look(unnamed, find_next(unnamed, [])))
    assert "names       none: 2 trajectories without a name" in text
    assert find_next(unnamed, []) == [f"besman annotate {tmp_path / 'c.tsv'}"]


def test_what_stands_still_and_whose_names_they_are(tmp_path):
    positions = np.tile(walk(1, 3), (60, 1, 1))
    path = write(tmp_path / "a.tsv", ("Ann:a", "Bob:b", "Ann:c"), positions)
    look = look_at(path)
    text = "\n".join(describe_look(look, []))
    assert "nothing moves by more than 2 cm" in text
    assert look.subjects == ("Ann", "Bob")
    assert "; of Ann, Bob" in text


def test_warnings_of_the_reader_are_part_of_the_page(tmp_path):
    positions = walk(60, 2)
    positions[10, 0] = 0.0
    path = write(tmp_path / "a.tsv", ("a", "b"), positions)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        look = look_at(path)
    assert len(look.warnings) == 1
    text = "\n".join(describe_look(look, []))
    assert "  warning     1 sample of 1 trajectory at exactly 0, 0, 0" in text
    assert "  note        1 samples at exactly 0, 0, 0 are gaps" in text


def test_an_unknown_file_says_what_it_looks_like(monkeypatch, tmp_path, capsys):
    path = tmp_path / "a.xlsx"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(RecordingError, match="format that is not known: it looks like an archive"):
        look_at(path)
    assert besman(monkeypatch, "segment", path) == 2
    line = capsys.readouterr().err.strip()
    assert line.endswith(f"; see: besman look {path}")
    assert besman(monkeypatch, "look", path) == 2
    line = capsys.readouterr().err.strip()
    assert "see: besman look" not in line
    assert all(one.name in line for one in FORMATS)


def test_a_folder_is_a_table_with_a_row_for_what_cannot_be_read(monkeypatch, tmp_path, capsys):
    (tmp_path / "good.tsv").write_bytes(NAMED.read_bytes())
    (tmp_path / "bad.c3d").write_bytes(b"\x02P nothing")
    found = look_at_all([tmp_path / "bad.c3d", tmp_path / "good.tsv"])
    assert found[0][0].name == "bad.c3d"
    assert not found[0][1].startswith(str(tmp_path))
    out = tmp_path / "out.json"
    assert besman(monkeypatch, "look", tmp_path, "--json", out) == 0
    text, said = capsys.readouterr()
    assert all(one in text for one in ("bad.c3d", "not read", "right_arm"))
    assert "1 of 2 cannot be read: besman look FILE says why" in said
    rows = json.loads(out.read_text())
    assert [sorted(row)[:1] for row in rows] == [["error"], ["duration_s"]]
    (tmp_path / "good.tsv").unlink()
    assert besman(monkeypatch, "look", tmp_path) == 2
    assert "none of 1 recordings can be read" in capsys.readouterr().err


def test_a_folder_of_one_set_says_how_to_go_on(tmp_path):
    found = [look_at(NAMED), look_at(SAMPLE / "subject2.tsv")]
    last = find_next_of_all([SAMPLE], found, [])[-1]
    assert last == f"besman run ur5_stick_throw --set recordings={SAMPLE}"
    assert find_next_of_all([SAMPLE], [*found, (NAMED, "broken")], []) == []
    assert find_next_of_all([NAMED, SAMPLE], found, []) == []


def test_one_marker_set_is_held_against_a_recording(monkeypatch, tmp_path, capsys):
    own = tmp_path / "own.yaml"
    assert besman(monkeypatch, "markers", "new", NAMED, "--out", own) == 0
    assert besman(monkeypatch, "look", NAMED, "--markers", own) == 0
    text = capsys.readouterr().out
    assert "marker set  own: 9 of its 9 markers, all that it requires" in text
    assert f"besman segment {NAMED} --markers {own}" in text
    assert f"--set label.markers={own}" in text
    assert besman(monkeypatch, "look", NAMED, "--markers", "plug_in_gait") == 0
    text = capsys.readouterr().out
    assert "marker set  does not fit; plug_in_gait: 3 of its" in text
    assert "markers new" not in text
    assert besman(monkeypatch, "look", SAMPLE, "--markers", "rihgt_arm") == 2
    assert "did you mean 'right_arm'" in capsys.readouterr().err
    unnamed = write(tmp_path / "a.tsv", (None, None), walk(50, 2))
    assert besman(monkeypatch, "look", unnamed, "--markers", own) == 0
    text = capsys.readouterr().out
    assert "names have to be found first" in text
    assert f"besman annotate {unnamed} --markers {own}" in text


def test_a_set_without_a_person_is_told(tmp_path):
    set_file = tmp_path / "three.yaml"
    set_file.write_text(
        "name: three\nmarkers: {a: [], b: []}\nrequired: [a, b]\nclusters: {c: [a, b]}\n"
    )
    look = look_at(write(tmp_path / "a.tsv", ("a", "b"), walk(50, 2)), str(set_file))
    assert look.best.is_complete
    assert look.fault.startswith("no marker 'back_top': the person's frame needs")
    assert not any("run" in command.split() for command in find_next(look, []))


def test_many_markers_that_are_not_there_are_counted(tmp_path):
    set_file = tmp_path / "many.yaml"
    names = [f"m{k}" for k in range(30)]
    listed = ", ".join(f"{name}: []" for name in names)
    set_file.write_text(
        f"{{name: many, markers: {{{listed}}}, required: {names}, clusters: {{c: {names}}}}}"
    )
    look = look_at(write(tmp_path / "a.tsv", ("m0", "x"), walk(50, 2)), str(set_file))
    assert "m12 and 17 more" in "\n".join(describe_look(look, []))


def test_a_file_that_begins_with_a_dash_can_be_pasted(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "-a b.tsv", ("x", "y"), walk(50, 2))
    (command,) = find_next(look_at(Path("-a b.tsv")), [])
    assert shlex.split(command) == [
        *("besman", "markers", "new", "./-a b.tsv", "--out", "./-a b_markers.yaml")
    ]  # fmt: skip


def test_a_page_as_json(monkeypatch, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert besman(monkeypatch, "look", NAMED, "--json", out, "--up", "z") == 0
    capsys.readouterr()
    content = json.loads(out.read_text())
    look = look_at(NAMED)
    assert content["frames"] == len(look.recording.time)
    assert content["up"] == {"axis": "z", "by": "asked for"}
    assert content["marker_sets"][0]["trajectories"]["hand_top"] == "Hand top"
    assert content["next"][0].endswith("--up z")
    assert content.keys() == content_of(look, []).keys()


def test_a_plot_is_of_one_recording(monkeypatch, tmp_path, capsys):
    picture = tmp_path / "a.png"
    assert besman(monkeypatch, "look", SAMPLE, "--plot", picture) == 2
    assert "--plot: several recordings; expected one" in capsys.readouterr().err
    assert besman(monkeypatch, "look", NAMED, "--plot", picture) == 0
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_the_page_in_the_documentation_is_what_is_printed(monkeypatch, capsys):
    monkeypatch.chdir(TOP)
    assert besman(monkeypatch, "look", "data/stick_throw/subject1.tsv") == 0
    assert f"```text\n{capsys.readouterr().out}```" in (TOP / "docs/howto/recording.md").read_text()


@pytest.mark.parametrize("most", [7, 100, 10**6])
def test_an_extent_is_that_of_every_so_many_samples_seen(monkeypatch, most):
    monkeypatch.setattr("besman.standalone.look_files._MOST_MEASURED", most)
    rng = np.random.default_rng(2)
    positions = rng.normal(size=(90, 4, 3))
    positions[rng.random((90, 4)) < 0.6] = np.nan
    seen = positions[np.isfinite(positions).all(axis=2)]
    low, high = np.percentile(seen[:: max(1, len(seen) // most)], [0.5, 99.5], axis=0)
    np.testing.assert_array_equal(measure_extent(positions), high - low)
    assert np.isnan(measure_extent(np.full((3, 2, 3), np.nan))).all()


def test_a_folder_has_a_line_for_all_that_looks_like_a_recording(monkeypatch, tmp_path, capsys):
    folder = tmp_path / "mixed"
    write_panoptic(folder / "take", 4)
    write(folder / "a.tsv", ("a",), walk(20, 1))
    (folder / "angles.mot").write_text("Coordinates\nversion=1\nendheader\ntime\ta\n")
    (folder / "broken.trc").write_text("nothing")
    (folder / "README.md").touch()
    (folder / "plot.py").touch()
    segments_path(folder / "a.tsv").write_text("[]")
    pictures = folder / "openpose"
    pictures.mkdir()
    for number in range(3):
        frame = {"people": [{"pose_keypoints_2d": [1.0, 2.0, 0.5]}]}
        (pictures / f"v_{number:012d}_keypoints.json").write_text(json.dumps(frame))
    monkeypatch.setenv("COLUMNS", "300")
    assert besman(monkeypatch, "look", str(folder), "--json", str(tmp_path / "a.json")) == 0
    told = capsys.readouterr()
    rows = {line.split()[0]: line for line in told.out.splitlines()[1:] if line.split()}
    assert "Qualisys TSV" in rows["a.tsv"]
    assert "keypoints JSON" in rows["take"]
    assert "angles or forces (.mot, .sto), without positions: give the TRC" in rows["angles.mot"]
    assert "is not TRC as its ending says" in rows["broken.trc"]
    assert "expected" not in rows["broken.trc"]
    assert "3 files of one frame each: points in a picture" in rows["v_*_keypoints.json"]
    assert "besides 2 files that are no recordings: plot.py, README.md" in told.out
    assert "3 of 5 cannot be read" in told.err
    errors = [row for row in json.loads((tmp_path / "a.json").read_text()) if "error" in row]
    assert len(errors) == 3
    assert besman(monkeypatch, "look", str(pictures)) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_of_one_frame_a_file_has_a_page(monkeypatch, tmp_path, capsys):
    folder = write_panoptic(tmp_path / "take", 4, people=2)
    (folder / "calibration.json").write_text('{"cameras": 3}')
    monkeypatch.chdir(folder)
    assert besman(monkeypatch, "look", ".") == 0
    told = capsys.readouterr().out
    assert "time        29.97 Hz, 4 frames (100 to 103)" in told
    assert told.splitlines()[-1] == "besides 1 file that is no recording: calibration.json"
    # Of two people one is chosen first.
    assert f"besman look {folder} --subject person0\n" in told
    with reading(subject="person0"):
        look = look_at(folder)
    assert find_next(look, [])[1].startswith(f"besman annotate {folder}")
    segments = [{"start index": 100, "end index": 102, "label": "wave"}]
    segments_path(folder).write_text(json.dumps(segments))
    assert [one.split()[1] for one in find_next(look, [])] == ["segment", "check", "run"]
    assert find_next(look, [])[-1].endswith("--set select.label=wave")


def test_many_files_that_differ_in_a_number_have_one_line(monkeypatch, tmp_path, capsys):
    for number in range(20):
        (tmp_path / f"{number:06d}.json").write_text('[{"Rh": [1, 2, 3], "pose": [1, 2, 3, 4]}]')
        (tmp_path / f"take{number}.tak").write_text("x")
    (tmp_path / "other.mot").write_text("Coordinates\nendheader\n")
    monkeypatch.setenv("COLUMNS", "300")
    assert besman(monkeypatch, "look", str(tmp_path)) == 2
    told = capsys.readouterr()
    rows = {line.split()[0]: line for line in told.out.splitlines()[1:]}
    assert set(rows) == {"*.json", "take*.tak", "other.mot"}
    assert "20 files, the first: " in rows["*.json"]
    assert "20 files, the first: by its ending it is a take of Motive" in rows["take*.tak"]
