"""What the report says in the terminal."""

import pytest

from besman.report.terminal import outcome_lines


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ([(9, 0), (9, 0)], "marker names: 18 taken from the recordings"),
        ([(0, 9), (0, 9)], "marker names: 18 found among trajectories without names"),
        ([(9, 0), (5, 4)], "marker names: 14 taken from the recordings, 4 found among"),
        ([(0, 0)], "marker names: 0 taken from the recordings"),
    ],
)
def test_where_marker_names_come_from(counts, said):
    names = [{"recording": "a", "taken": taken, "found": found} for taken, found in counts]
    (line,) = outcome_lines({"label": {"names": names}})
    assert line.startswith(said)


def test_of_a_run_from_before_nothing_is_said_of_names():
    assert outcome_lines({"label": {}}) == []
