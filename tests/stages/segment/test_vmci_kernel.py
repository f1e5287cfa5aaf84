"""Evidence of segments, block by block, against the plain equations."""

import numpy as np
import pytest

from besman.stages.segment.vmci import VmciModel
from besman.stages.segment.vmci_kernel import BLOCK, evaluate_block, start_root
from besman.stages.segment.vmci_plain import evaluate_segments


@pytest.mark.parametrize(("n", "d", "s", "first"), [(70, 3, 1, 0), (90, 2, 2, 20)])
def test_evidence_is_that_of_the_equations(n, d, s, first):
    random = np.random.default_rng(n)
    y = np.cumsum(random.normal(size=(n, d)), axis=0)
    v = np.abs(random.normal(size=(n, s)))
    model, longest = VmciModel(n_centres=3), 30
    expected = evaluate_segments(y, v, longest, model)
    before = np.concatenate([y[:1], y[:-1]])
    pad = ((longest, 0), (0, 0))
    width = min(BLOCK, n - first)
    found = np.empty((width, longest + 1))
    evaluate_block(
        np.ascontiguousarray(np.pad(np.concatenate([before, y], axis=1), pad).T),
        np.ascontiguousarray(np.pad(v, pad).T), first, width, np.zeros(longest + 1),
        model.n_centres, model.bell_width, model.weight_variance, model.speed_weight_variance,
        model.noise_scale, model.nu(d), model.nu(s), False, found,
    )  # fmt: skip
    for b in range(width):
        lengths = np.arange(1, min(longest, first + b + 1) + 1)
        np.testing.assert_allclose(found[b, lengths], expected[first + b + 1, lengths], rtol=1e-7)


def test_the_root_of_the_prior_is_diagonal():
    root = np.full((4, 4), np.nan)
    start_root(root, 4.0, 9.0)
    np.testing.assert_array_equal(root, np.diag([0.5, 0.5, 3.0, 3.0]))
