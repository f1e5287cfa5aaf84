from dataclasses import replace

import numpy as np
import pytest
from command_line import besman
from places import SAMPLE

from besman.exceptions import LabellingError
from besman.io.recordings.formats import read_recording, write_recording
from besman.person.marker_set import load_marker_set
from besman.records import Recording
from besman.stages.label.stage import LabelConfig
from besman.standalone.propose_set import measure_ways, propose_set, write_marker_set

NAMED = SAMPLE / "subject1.tsv"
PALM_DOWN = np.array(
    [[0, 0.2, 1.45], [0, -0.2, 1.45], [0, -0.25, 1.15], [0.25, -0.22, 1.15], [0.25, -0.28, 1.15],
     [0.34, -0.25, 1.15], [-0.1, 0, 1.5]]
)  # fmt: skip
ARMS = ("LSHO", "RSHO", "RELB", "RWRA", "RWRB", "RFIN", "C7")


def record(names, seed=0, n=60):
    rng = np.random.default_rng(seed)
    positions = 1.2 + rng.normal(scale=0.3, size=(len(names), 3))
    positions = positions + np.cumsum(rng.normal(scale=0.01, size=(n, len(names), 3)), axis=0)
    return Recording(np.arange(n) / 100, positions, tuple(names), 100.0, "a.tsv")


def test_the_set_of_the_sample_has_its_markers_and_clusters(tmp_path):
    proposed = write_marker_set(NAMED, tmp_path / "mine.yaml")
    recording = read_recording(NAMED)
    assert len(proposed.match(recording.names, "a.tsv")) == len(recording.names)
    groups = [set(group) for group in proposed.clusters.values()]
    for body in ("back", "hand"):
        members = {f"{body}_{part}" for part in ("top", "left", "right")}
        assert any(members <= group for group in groups)
    assert proposed.roles["hand"] == "hand_top"


def test_arms_told_by_names_become_frames(tmp_path):
    path = tmp_path / "mine.yaml"
    recording = record([f"Ann:{name}" for name in ARMS])
    # A right arm bent by a quarter turn, palm down; the hand moves a little.
    recording = replace(recording, positions=PALM_DOWN + 0.01 * recording.positions)
    path.write_text(propose_set(recording, "mine"))
    proposed = load_marker_set(str(path))
    assert proposed.frames.hand.thumb_side == ("rwra",)
    assert proposed.frames.hand.fingers == ("rfin",)
    assert set(proposed.required) == {"lsho", "rsho", "relb", "rwra", "rwrb", "rfin"}
    (labelled,) = LabelConfig(markers=str(path)).run((recording,), proposed)
    assert np.isfinite(labelled.marker("hand_top")).all()
    assert "# Guessed by names" in path.read_text()


def test_names_that_tell_nothing_are_left_to_a_person(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(propose_set(record(["A 1", "a-1", "", "7", None, "ball: x"]), "mine"))
    proposed = load_marker_set(str(path))
    assert list(proposed.markers) == ["a_1", "a_1_no_2", "marker_3", "marker_7", "marker_5", "x"]
    assert "Not told by names: which markers are shoulder, elbow and hand" in path.read_text()
    assert proposed.roles == {}


def test_without_names_the_places_are_the_pose(tmp_path):
    recording = record([None] * 4)
    path = tmp_path / "mine.yaml"
    path.write_text(propose_set(recording, "mine"))
    proposed = load_marker_set(str(path))
    assert len(proposed.pose_m) == 4
    np.testing.assert_allclose(list(proposed.pose_m.values()), recording.positions[0], atol=6e-5)


def test_what_cannot_be_proposed_or_written(monkeypatch, tmp_path, capsys):
    unseen = Recording(np.arange(3) / 9, np.full((3, 2, 3), np.nan), ("a", "b"), 9.0, "a.tsv")
    with pytest.raises(LabellingError, match=r"a.tsv: no marker is ever seen in it"):
        propose_set(unseen, "mine")
    with pytest.raises(LabellingError, match=r"got ending '.txt', expected .yaml"):
        write_marker_set(NAMED, tmp_path / "mine.txt")
    target = tmp_path / "mine.yaml"
    assert besman(monkeypatch, "markers", "new", NAMED, "--out", target) == 0
    assert f"it is used with --markers {target}" in capsys.readouterr().out
    assert besman(monkeypatch, "markers", "new", NAMED, "--out", target) == 2
    assert "is there already; give another name with --out" in capsys.readouterr().err


def test_the_command_asks_for_what_names_do_not_tell(monkeypatch, tmp_path, capsys):
    write_recording(record(["p", "q", "r"]), tmp_path / "a.tsv")
    besman(monkeypatch, "markers", "new", tmp_path / "a.tsv", "--out", tmp_path / "m.yaml")
    assert "shoulder, elbow and hand are not told by names" in capsys.readouterr().out


def test_markers_that_every_rigid_body_calls_alike_keep_whose_they_are(tmp_path):
    names = ("Back:Marker1", "Back:Marker2", "Hand:Marker1", "Hand:Marker2", "Ann:Elbow")
    recording = record(names)
    path = tmp_path / "set.yaml"
    path.write_text(propose_set(recording, "mine"))
    found = load_marker_set(str(path))
    assert list(found.markers) == [
        "back_marker1", "back_marker2", "hand_marker1", "hand_marker2", "elbow",
    ]  # fmt: skip
    assert found.match(recording.names, "a.csv") == dict(zip(found.markers, range(5), strict=True))


def test_names_without_a_side_and_the_way_of_clusters_help_to_name_the_rest():
    t = np.linspace(0.0, 4.0, 200)
    still = 0.1 * np.eye(3) + [0.0, 0.0, 1.3]
    hand = 0.05 * np.eye(3) + [0.4, 0.0, 1.0]
    swing = np.stack([0.3 * np.sin(3 * t), 0 * t, 0.1 * np.sin(5 * t)], axis=1)
    positions = np.concatenate(
        [
            np.tile(still, (200, 1, 1)) + 0.05 * swing[:, None],
            hand + swing[:, None],
            0.5 * swing[:, None] + [0.2, 0.3, 1.2],
        ],
        axis=1,
    )
    names = (*(f"{body}:Marker{k}" for body in ("Torso", "Hand") for k in (1, 2, 3)), "Acromion")
    text = propose_set(Recording(t, positions, names, 50.0, "a.csv"), "a")
    said = " ".join(line.removeprefix("# ") for line in text.splitlines())
    assert "Guessed so far: shoulder acromion." in said
    ways = measure_ways(positions, 50.0)
    # What a path that is sampled finely has, less where it turns.
    finely = np.linalg.norm(np.diff(positions, axis=0), axis=2).sum(axis=0)
    np.testing.assert_allclose(ways, finely, rtol=0.05)
    assert (
        f"rigid_2 travels farthest ({ways[3:6].mean():.1f} m), as a hand does, rigid_1 least "
        f"({ways[:3].mean():.1f} m), as a back does."
    ) in said
