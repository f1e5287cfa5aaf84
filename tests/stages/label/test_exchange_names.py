"""Two alike markers whose names are exchanged in the middle of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from besman.stages.label.exchange_names import exchange_names
from besman.stages.label.fragments import measure_pairs, split_fragments
from besman.stages.label.scores import ScoreWeights, measure_ends
from besman.stages.label.trajectories import learn_from_recording


@pytest.fixture(scope="module")
def case(clean, teacher, marker_set):
    """Fragments with their true names; three gaps in both of two markers cut four stretches."""
    model = learn_from_recording(teacher, marker_set)
    columns = [clean.truth[0].index(name) for name in model.markers]
    positions = clean.positions[:800, [list(clean.markers).index(m) for m in model.markers]].copy()
    assert len(columns) == len(model.markers)
    a, b = (model.markers.index(name) for name in ("hand_left", "hand_right"))
    model = replace(model, alike=np.array([[min(a, b), max(a, b)]]))
    for begin in (200, 400, 600):
        positions[begin : begin + 10, [a, b]] = np.nan
    fragments = split_fragments(positions, clean.recording.rate_hz)
    return model, fragments, fragments.column.copy(), (a, b)


def exchanged(case, wrong):
    """Return the names after the exchange of those in some of the four stretches."""
    model, fragments, truth, (a, b) = case
    stretch = np.searchsorted([200, 400, 600], fragments.start, side="right")
    labels = truth.copy()
    turned = np.isin(labels, (a, b)) & np.isin(stretch, wrong)
    labels[turned] = a + b - labels[turned]
    pairs, ends = measure_pairs(fragments), measure_ends(fragments)
    return exchange_names(fragments, pairs, ends, labels, model, ScoreWeights())


@pytest.mark.parametrize("wrong", [(), (0,), (1, 2), (3,), (0, 1, 2, 3)])
def test_exchanged_stretches_get_their_names_back(case, wrong):
    labels, margin = exchanged(case, wrong)
    np.testing.assert_array_equal(labels, case[2])
    alike = np.isin(case[2], case[3])
    assert np.isinf(margin[~alike]).all()
    assert (margin[alike] > 0).all()
    assert np.isfinite(margin[alike]).all()
