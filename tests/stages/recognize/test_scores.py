import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.records import LabelledSegments
from besman.stages.recognize.model import Recipe, RecognitionModel
from besman.stages.recognize.scores import score_labels


def segments(*rows, source="a.tsv"):
    bounds = np.array([row[:2] for row in rows]).reshape(-1, 2)
    return LabelledSegments(
        bounds, tuple(row[2] for row in rows), np.zeros(len(rows)), 10.0, source
    )


def learnt(*bounds, source="a.tsv"):
    n = len(bounds)
    return RecognitionModel(
        method="nearest_neighbour",
        settings={},
        recipe=Recipe(("speeds",), ("hand_top",), (), 1),
        centre=np.zeros(1),
        spread=np.ones(1),
        examples=np.zeros((n, 1)),
        labels=("x",) * n,
        sources=(source,) * n,
        bounds=np.array(bounds).reshape(-1, 2),
        threshold=np.inf,
    )


TRUTH = segments((0, 20, "reach"), (20, 40, "rest"), (50, 70, "reach"))


def test_labels_are_compared_where_segments_overlap_enough():
    found = segments((0, 18, "reach"), (18, 39, "reach"), (39, 51, "idle"), (51, 70, "rest"))
    score = score_labels((found,), (TRUTH,), (70,), learnt())
    assert score.accuracy == pytest.approx(0.5)
    assert score.n_compared == 4
    assert score.per_class == {"idle": 1.0, "reach": 0.5, "rest": 0.0}
    assert score.confusion["reach"] == {"reach": 1, "rest": 1}


def test_segments_that_fit_none_are_not_compared():
    found = segments((10, 30, "wrong"), (0, 70, "wrong"))
    score = score_labels((found,), (TRUTH,), (70,), learnt())
    assert score.n_compared == 0
    assert np.isnan(score.accuracy)


def test_what_was_learnt_from_does_not_count():
    score = score_labels((TRUTH,), (TRUTH,), (70,), learnt([0, 20], [50, 70]))
    assert (score.n_compared, score.accuracy) == (1, 1.0)
    other = score_labels((TRUTH,), (TRUTH,), (70,), learnt([0, 20], source="b.tsv"))
    assert other.n_compared == 3


def test_records_of_different_recordings_are_refused():
    with pytest.raises(RecognitionError, match=r"labels of 'b.tsv' cannot be scored with manual"):
        score_labels((segments((0, 9, "x"), source="b.tsv"),), (TRUTH,), (70,), learnt())
