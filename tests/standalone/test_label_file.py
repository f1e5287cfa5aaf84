"""The command label-markers, in process."""

import json

import numpy as np
import pytest
from command_line import besman

from besman.config.resources import resource_folder
from besman.io.recordings.formats import read_recording, write_recording
from besman.person.marker_set import load_marker_set
from besman.records import Recording

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


def test_nothing_is_overwritten(unnamed, tmp_path, monkeypatch, capsys):
    (tmp_path / "o.tsv").write_text("mine")
    assert besman(monkeypatch, "label-markers", unnamed, "--out", tmp_path / "o.tsv") == 2
    assert "is there already; give another name with --out" in capsys.readouterr().err
    assert (tmp_path / "o.tsv").read_text() == "mine"


def test_a_figure_of_no_kind(unnamed, tmp_path, monkeypatch, capsys):
    arguments = (unnamed, "--out", tmp_path / "o.tsv", "--figure", tmp_path / "f.txt")
    assert besman(monkeypatch, "label-markers", *arguments) == 2
    assert "got ending '.txt', expected .png or .svg" in capsys.readouterr().err
