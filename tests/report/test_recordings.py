import re
from types import SimpleNamespace

import numpy as np
import pytest

from besman.records import LabelledRecording, LabelledSegments
from besman.report import figures
from besman.report.recordings import action_section, recording_section


@pytest.fixture(autouse=True)
def no_drawing(monkeypatch):
    """Names instead of drawings, which tests of their own look at."""
    for name in ("speed_profile", "time_line"):
        monkeypatch.setattr(figures, name, lambda *_, name=name: f"<{name}>")


@pytest.fixture(scope="module")
def records():
    """Fourteen short recordings, with labels that HTML would take for its own."""
    time = np.arange(50) / 50
    path = np.column_stack([np.sin(3 * time), np.zeros((50, 2))])[:, None]
    recordings, found = [], []
    for k in range(14):
        name = f"{k}.tsv"
        filled = np.zeros((50, 1), bool)
        recordings.append(LabelledRecording(time, path, ("hand",), filled, 50.0, name))
        bounds = np.array([[0, 25], [25, 50]])
        found.append(LabelledSegments(bounds, ("<up>", "down"), np.zeros(2), 50.0, name))
    levels = [SimpleNamespace(levels=(one,)) for one in found]
    return {"label": tuple(recordings), "recognize": tuple(found), "compose": tuple(levels)}


def test_recordings_are_drawn_evenly_with_a_key_of_their_labels(records):
    section = recording_section(records, {"segment": {"marker": "hand"}})
    assert section.count("<speed_profile>") == 12
    assert "Drawn are 12 of 14 recordings, evenly spaced in their order." in section
    (key,) = re.findall(r'<p class="key">.*?</p>', section)
    assert "&lt;up&gt;" in key
    assert "<up>" not in section
    assert "manual segments" not in section
    assert "0.tsv: speed of hand" in section
    assert "13.tsv: speed of hand" in section


def test_with_truth_the_caption_says_where_it_is(records):
    truth = {**records, "truth": records["recognize"]}
    assert "manual segments in the strip" in recording_section(
        truth, {"segment": {"marker": "hand"}}
    )


def test_actions_stand_above_their_blocks(records):
    assert action_section(records).count("<time_line>") == 12
    assert action_section({"recognize": records["recognize"]}) == ""
    assert recording_section({}, {}) == ""
