import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.records import Recording
from besman.report.recording_figure import draw_sticks_and_gaps, recording_figure


def record(names, n=100):
    rng = np.random.default_rng(2)
    positions = rng.random((len(names), 3)) + np.cumsum(rng.normal(0, 0.004, (n, 1, 3)), axis=0)
    return Recording(np.arange(n) / 50, positions, names, 50.0, "a $x$ <b>.tsv")


def bars(axes):
    """Start and end of every bar, by row."""
    found = {}
    for row, bar in enumerate(axes.collections):
        paths = [path.vertices[:, 0] for path in bar.get_paths()]
        found[row] = [(round(x.min(), 6), round(x.max(), 6)) for x in paths]
    return found


def test_bars_are_where_something_is_seen():
    given = record(("L1", "RELB", None))
    positions = given.positions.copy()
    positions[20:30, 1] = np.nan
    positions[90:, 2] = np.nan
    given = Recording(given.time, positions, given.names, 50.0, "a.tsv")
    axes = recording_figure(given, ()).axes[-1]
    assert bars(axes) == {0: [(0.0, 2.0)], 1: [(0.0, 0.4), (0.6, 2.0)], 2: [(0.0, 1.8)]}
    assert [one.get_text() for one in axes.get_yticklabels()] == ["L1", "RELB", "without name 3"]
    assert "1 of 3 all the time" in axes.get_title(loc="left")


def test_stick_figures_keep_heights_and_distances():
    given = record(("a", "b", "c", "d"))
    panels = recording_figure(given, ()).axes[:3]
    row = 0
    offsets = np.array(panels[0].collections[0].get_offsets())
    np.testing.assert_allclose(offsets[:, 1], given.positions[row, :, 2])
    flat = np.ptp(offsets[:, 0]), np.linalg.norm(np.ptp(given.positions[row, :, :2], axis=0))
    assert flat[0] <= flat[1]
    for panel in panels:
        assert panel.get_aspect() == 1.0


def test_names_of_any_kind_are_written_as_they_are():
    axes = recording_figure(record(("$a_1$", "b\\c")), ()).axes[1]
    assert sorted(one.get_text() for one in axes.texts) == ["$a_1$", "b\\c"]
    assert not any(one.get_parse_math() for one in axes.texts)


def test_of_many_names_only_those_of_the_set_are_written():
    names = tuple(f"m{number}" for number in range(30))
    axes = recording_figure(record(names), ("m3", "m7")).axes[1]
    assert sorted(one.get_text() for one in axes.texts) == ["m3", "m7"]


def test_what_cannot_be_drawn(tmp_path):
    with pytest.raises(RecordingError, match=r"got ending '.pdf', expected .png or .svg"):
        draw_sticks_and_gaps(record(("a", "b")), (), tmp_path / "a.pdf")
    unseen = Recording(np.arange(3) / 9, np.full((3, 2, 3), np.nan), ("a", "b"), 9.0, "a.tsv")
    with pytest.raises(RecordingError, match=r"a.tsv: nothing is ever seen in it"):
        draw_sticks_and_gaps(unseen, (), tmp_path / "a.png")
    draw_sticks_and_gaps(record(("a", "b")), (), tmp_path / "a.svg")
    assert (tmp_path / "a.svg").read_text().count("<svg") == 1
