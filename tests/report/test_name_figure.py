import numpy as np

from besman.report.name_figure import name_timeline
from besman.stages.label.named_recording import NameDecision, NamedRecording


def test_every_decision_is_a_bar_in_the_lane_of_its_marker():
    n, rate_hz = 100, 50.0
    positions = np.zeros((n, 2, 3))
    filled = np.zeros((n, 2), dtype=bool)
    filled[20:30, 0] = True
    decisions = (
        NameDecision(0, 0, 20, "a", 0.99, True),
        NameDecision(1, 0, n, "b", 0.95, True),
        NameDecision(2, 30, n, "a", 0.9, True),
        NameDecision(3, 10, 40, "", 0.99, False),
        NameDecision(4, 20, 60, "a", 0.3, False),
    )
    named = NamedRecording(
        np.arange(n) / rate_hz, positions, ("a", "b"), filled, rate_hz, "x.tsv",
        decisions=decisions, threshold=0.8,
    )  # fmt: skip
    (axes,) = name_timeline(named).axes
    bars = [
        tuple(np.round([box.x0, box.x1, 0.5 * (box.y0 + box.y1)], 3).tolist())
        for bar in axes.collections
        for box in (path.get_extents() for path in bar.get_paths())
    ]
    # Start and end in seconds, and the row: markers first, then lanes of what has no name.
    assert sorted(bars) == sorted([
        (0.0, 0.4, 0.0), (0.6, 2.0, 0.0), (0.4, 0.6, 0.0), (0.0, 2.0, 1.0),
        (0.2, 0.8, 2.0), (0.4, 1.2, 3.0),
    ])  # fmt: skip
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b", "unnamed", ""]
    assert "x.tsv: 3 fragments named, 2 not" in axes.get_title(loc="left")
