"""The command label-markers, in process."""

import json

import numpy as np
import pytest
from command_line import besman

from besman.config.resources import resource_folder
from besman.io.recordings.formats import read_recording, write_recording
from besman.person.marker_set import load_marker_set
from besman.records import Recording
from besman.stages.recognize.model_files import load_model
from besman.standalone.segment_files import segment_files
from besman.standalone.train_files import train_files

SAMPLE = resource_folder("data") / "stick_throw"


@pytest.fixture(scope="module")
def unnamed(tmp_path_factory):
    """The second person's recording, ten seconds, with gaps, a ghost and no names."""
    named = read_recording(SAMPLE / "subject2.tsv")
    positions = named.positions[:1000].copy()
    positions[300:315, 2] = np.nan
    ghost = np.full((1000, 1, 3), np.nan)
    ghost[500:510] = positions[505, :1] + 0.4
    positions = np.concatenate((positions, ghost), axis=1)[:, ::-1]
    path = tmp_path_factory.mktemp("unnamed") / "take.tsv"
    recording = Recording(
        named.time[:1000], positions, (None,) * positions.shape[1], named.rate_hz, path.name
    )
    write_recording(recording, path)
    return path


@pytest.mark.parametrize("ending", ["tsv", "c3d"])
def test_names_come_back(unnamed, tmp_path, monkeypatch, capsys, ending):
    out, figure, report = tmp_path / f"o.{ending}", tmp_path / "f.png", tmp_path / "r.json"
    teacher = SAMPLE / "subject1.tsv"
    arguments = (
        unnamed, "--markers", "right_arm", "--learn-from", teacher, "--out", out,
        "--figure", figure, "--json", report,
    )  # fmt: skip
    assert besman(monkeypatch, "label-markers", *arguments) == 0
    assert "hand_top" in capsys.readouterr().out
    found, true = read_recording(out), read_recording(SAMPLE / "subject2.tsv")
    marker_set = load_marker_set("right_arm")
    columns, places = (marker_set.match(r.names, r.source) for r in (found, true))
    for marker in marker_set.required:
        there = found.positions[:, columns[marker]]
        seen = np.isfinite(there[:, 0])
        assert seen.sum() >= 985
        expected = true.positions[:1000, places[marker]]
        np.testing.assert_allclose(there[seen], expected[seen], atol=2e-6)
    # What got no name is still there.
    assert None in found.names
    summary = json.loads(report.read_text())
    assert summary["n_unnamed"] >= 1
    assert summary["named_share"] > 0.9
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_gaps_stay_unless_filled(unnamed, tmp_path, monkeypatch):
    teacher = SAMPLE / "subject1.tsv"
    missing = []
    for name, *more in (("a.tsv",), ("b.tsv", "--fill")):
        arguments = (unnamed, "--learn-from", teacher, "--out", tmp_path / name, *more)
        assert besman(monkeypatch, "label-markers", *arguments) == 0
        found = read_recording(tmp_path / name)
        columns = [k for k, n in enumerate(found.names) if n and n != "stick"]
        missing.append(int(np.isnan(found.positions[:, columns, 0]).sum()))
    assert missing == [15, 0]


def test_names_that_fit_are_kept_and_all_others_too(tmp_path, monkeypatch):
    whole = read_recording(SAMPLE / "subject2.tsv")
    # One is called by another's name, one has none, one is no marker of the set.
    circle = {"Hand left": "hand_right", "Hand right": "hand_top", "Hand top": "hand_left"}
    wrong = {**circle, "Elbow": None, "Stick": "toy"}
    names = tuple(wrong.get(name, name) for name in whole.names)
    part = Recording(whole.time[:1000], whole.positions[:1000], names, whole.rate_hz, "take.tsv")
    write_recording(part, tmp_path / "take.tsv")
    given = (tmp_path / "take.tsv", "--learn-from", SAMPLE / "subject1.tsv", "--out")
    assert besman(monkeypatch, "label-markers", *given, tmp_path / "kept.tsv") == 0
    anew = (*given, tmp_path / "anew.tsv", "--ignore-names")
    assert besman(monkeypatch, "label-markers", *anew) == 0
    kept, found = (read_recording(tmp_path / name) for name in ("kept.tsv", "anew.tsv"))
    at = {name: k for k, name in enumerate(whole.names)}
    for recording, exchanged in ((kept, True), (found, False)):
        for marker, called in (("elbow", "Elbow"), ("hand_left", "Hand left")):
            true = "Hand top" if exchanged and called == "Hand left" else called
            expected = whole.positions[:1000, at[true]]
            there = recording.positions[:, recording.names.index(marker)]
            np.testing.assert_allclose(there, expected, atol=2e-6)
    assert "toy" in kept.names
    assert "stick" not in kept.names
    assert {"toy", "stick"} & set(found.names) == {"stick"}


def test_a_recording_without_names_is_segmented_and_taught_from(unnamed, tmp_path):
    teacher = SAMPLE / "subject1.tsv"
    truth = json.loads((SAMPLE / "subject2_manually_segmented.json").read_text())
    inside = [one for one in truth["segments"] if one["end index"] < 1000]
    folder = tmp_path / "take"
    folder.mkdir()
    (folder / "take.tsv").write_bytes(unnamed.read_bytes())
    (folder / "take_manually_segmented.json").write_text(json.dumps(inside))
    whole = read_recording(SAMPLE / "subject2.tsv")
    part = Recording(whole.time[:1000], whole.positions[:1000], whole.names, whole.rate_hz, "n.tsv")
    write_recording(part, tmp_path / "n.tsv")
    (one,) = segment_files([unnamed], "valley_vmci", "right_arm", None, teacher)
    (other,) = segment_files([tmp_path / "n.tsv"], "valley_vmci", "right_arm", None)
    np.testing.assert_allclose(one["borders_s"], other["borders_s"], atol=0.03)
    model, _ = train_files([folder], tmp_path / "model", "right_arm", (), teacher)
    taught = load_model(model).labels
    assert {"throw", "swing_out", "strike_out"} <= set(taught)


def test_nothing_is_overwritten(unnamed, tmp_path, monkeypatch, capsys):
    (tmp_path / "o.tsv").write_text("mine")
    assert besman(monkeypatch, "label-markers", unnamed, "--out", tmp_path / "o.tsv") == 2
    assert "is there already; give another name with --out" in capsys.readouterr().err
    assert (tmp_path / "o.tsv").read_text() == "mine"


def test_a_figure_of_no_kind(unnamed, tmp_path, monkeypatch, capsys):
    arguments = (unnamed, "--out", tmp_path / "o.tsv", "--figure", tmp_path / "f.txt")
    assert besman(monkeypatch, "label-markers", *arguments) == 2
    assert "got ending '.txt', expected .png or .svg" in capsys.readouterr().err
