from dataclasses import replace

import numpy as np
import pytest
from small_runs import refined

from besman.report.html_tables import html_table, sort_key
from besman.report.motion_figures import best_so_far, learning_curve, quantiles
from besman.report.timing import seconds


def test_best_so_far_is_the_best_of_all_before():
    rng = np.random.default_rng(0)
    curves = [rng.normal(size=n) for n in (7, 3, 12)]
    curves[0][:2], curves[2][5] = np.nan, np.nan
    for greatest, best in ((False, np.nanmin), (True, np.nanmax)):
        found = best_so_far(curves, greatest)
        assert found.shape == (3, 12)
        for row, curve in enumerate(curves):
            for at in range(12):
                before = curve[: at + 1]
                if np.isnan(before).all():
                    assert np.isnan(found[row, at])
                else:
                    assert found[row, at] == best(before)


def test_quantiles_leave_out_what_is_not_there():
    values = np.array([[1.0, np.nan, np.nan], [3.0, 4.0, np.nan], [5.0, 8.0, np.nan]])
    np.testing.assert_array_equal(quantiles(values, (0.0, 0.5))[:, :2], [[1, 4], [3, 6]])
    assert np.isnan(quantiles(values, (0.5,))[0, 2])


def test_a_second_round_is_seen_in_the_learning_curve(make_plan):
    once = replace(
        refined(make_plan(0.1)),
        returns=np.zeros(3),
        misses=np.array([0.3, 0.2, 0.1]),
        simulations=np.array([1, 9, 9]),
        **{name: np.empty(shape) for name, shape in (("outcomes", (0, 3)), ("generations", 0))},
    )
    again = replace(once, begins_again=2)
    marked = [learning_curve([once, one], 0.05) for one in (once, again)]
    assert ["second round begins" in drawing for drawing in marked] == [False, True]


def test_what_has_no_outcome_yet_counts_as_worst():
    values = np.array([[np.inf, np.inf, 1.0], [2.0, np.inf, 1.0], [1.0, 1.0, 3.0]])
    np.testing.assert_array_equal(quantiles(values, (0.5,)), [[2.0, np.inf, 1.0]])


@pytest.mark.parametrize(
    ("cell", "key"),
    [
        ("1.5", "1.5"),
        ("-2 cm", "-2"),
        ('<span class="bad">no</span>', "no"),
        ("18 / 20", "18"),
        ("-", ""),
        ("", ""),
        ("2subjects.tsv:3", "2subjects.tsv:3"),
        ("a &lt;b&gt;", "a <b>"),
    ],
)
def test_cells_are_sorted_by_number_or_text(cell, key):
    assert sort_key(cell) == key


def test_a_sort_key_cannot_leave_its_attribute():
    assert 'data-sort="&quot;&gt;x"' in html_table(["a"], [["&quot;&gt;x"]], sortable=True)


def test_durations_for_people():
    assert [seconds(value) for value in (9000.0, 3000.0, 4.0)] == ["2:30 h", "50:00 min", "4.00 s"]
