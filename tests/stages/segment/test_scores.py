import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from besman.exceptions import SegmentationError
from besman.records import LabelledSegments, Segments
from besman.stages.segment.scores import manual_borders, match_borders, mean_score, score_borders


def found(borders, rate_hz=10.0, source="a.tsv"):
    rows = np.array(borders)
    return Segments(np.stack([rows[:-1], rows[1:]], axis=1), -1.0, rate_hz, source)


def manual(rows, rate_hz=10.0, source="a.tsv"):
    bounds = [row[:2] for row in rows]
    labels = tuple(row[2] if len(row) > 2 else "move" for row in rows)
    return LabelledSegments(np.array(bounds), labels, np.zeros(len(rows)), rate_hz, source)


def test_gaps_are_segments_and_parts_are_not():
    truth = manual([(0, 20), (0, 9, "move_part"), (25, 40), (40, 60)])
    np.testing.assert_array_equal(manual_borders(truth), [0, 20, 25, 40, 60])


def test_files_that_name_the_last_frame_have_the_same_borders():
    truth = manual([(0, 19), (20, 39), (45, 59), (60, 80)])
    np.testing.assert_array_equal(manual_borders(truth), [0, 20, 39, 45, 60, 80])


def test_each_border_counts_once():
    pairs = match_borders([1.0, 1.1, 5.0], [1.05, 5.2], 0.3)
    assert sorted(pairs[:, 1]) == [0, 1]
    assert len(match_borders([1.0], [0.9, 1.1], 0.3)) == 1


def test_a_chain_is_matched_as_far_as_it_can_be():
    # Taking the nearest first would pair 0.2 with 0.25 and leave two borders alone.
    pairs = match_borders([0.0, 0.2], [0.25, 0.5], 0.3)
    np.testing.assert_array_equal(pairs, [[0, 0], [1, 1]])


def count_greedily(found_s, true_s, margin_s):
    count, k = 0, 0
    for border in sorted(found_s):
        while k < len(true_s) and sorted(true_s)[k] < border - margin_s - 1e-9:
            k += 1
        if k < len(true_s) and sorted(true_s)[k] <= border + margin_s + 1e-9:
            count, k = count + 1, k + 1
    return count


times = st.lists(st.integers(0, 100).map(lambda k: k / 20), max_size=8, unique=True)


@given(times, times)
def test_as_many_pairs_as_a_sweep_finds(found_s, true_s):
    pairs = match_borders(found_s, true_s, 0.3)
    assert len(pairs) == count_greedily(found_s, true_s, 0.3)
    assert len(set(pairs[:, 0])) == len(set(pairs[:, 1])) == len(pairs)


@given(times, times)
def test_where_there_is_nothing_to_choose_the_choice_is_that_of_scipy(found_s, true_s):
    margin_s = 0.12
    distance = np.abs(np.subtract.outer(found_s, true_s))
    near = distance <= margin_s + 1e-9
    rows, columns = linear_sum_assignment(np.where(near, distance, 100.0))
    kept = near[rows, columns] if len(rows) else np.empty(0, dtype=bool)
    pairs = match_borders(found_s, true_s, margin_s)
    np.testing.assert_allclose(
        distance[tuple(pairs.T)].sum(), distance[rows[kept], columns[kept]].sum(), atol=1e-9
    )
    if near.size and max(near.sum(axis=0).max(), near.sum(axis=1).max()) <= 1:
        np.testing.assert_array_equal(pairs, np.stack([rows[kept], columns[kept]], axis=1))


def test_a_border_on_the_margin_counts():
    assert score_borders(found([0, 13, 30]), manual([(0, 10), (10, 29)])).tp == 1


def test_only_inner_borders_count_unless_the_end_is_asked_for():
    segments, truth = found([0, 12, 20, 40]), manual([(0, 10), (10, 39)])
    score = score_borders(segments, truth)
    assert (score.tp, score.fp, score.fn) == (1, 1, 0)
    assert score.f1 == pytest.approx(2 / 3)
    assert score.median_offset_s == pytest.approx(0.2)
    with_end = score_borders(segments, truth, count_end=True)
    assert (with_end.tp, with_end.fp, with_end.fn) == (2, 1, 0)


def test_nothing_to_find_and_nothing_found_is_right():
    score = score_borders(found([0, 40]), manual([(0, 39)]))
    assert score.f1 == 1.0
    assert np.isnan(score.median_offset_s)


def test_means_are_over_recordings():
    segments = (found([0, 12, 20, 40]), found([0, 30], source="b.tsv"))
    truth = (manual([(0, 10), (10, 39)]), manual([(0, 15), (15, 29)], source="b.tsv"))
    score = mean_score(segments, truth)
    assert score.f1 == pytest.approx(1 / 3)
    assert (score.tp, score.fp, score.fn) == (0.5, 0.5, 0.5)
    assert score.median_offset_s == pytest.approx(0.2)


def test_records_of_different_recordings_are_refused():
    with pytest.raises(SegmentationError, match=r"segments of 'a.tsv' at 10 Hz cannot be scored"):
        score_borders(found([0, 40]), manual([(0, 39)], source="b.tsv"))
