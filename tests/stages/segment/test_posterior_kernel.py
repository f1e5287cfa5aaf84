"""The compiled sums against sums in plain NumPy over the evidence of the plain recursion."""

import numpy as np
import pytest
from scipy.special import logsumexp

from besman.stages.segment.posterior_kernel import run_forward_backward
from besman.stages.segment.vmci import VmciModel, tabulate_lengths
from besman.stages.segment.vmci_kernel import evaluate_block


def arguments(n, longest, model):
    random = np.random.default_rng(n)
    y = np.cumsum(random.normal(size=(n, 2)), axis=0)
    v = np.abs(random.normal(size=(n, 1)))
    factor = tabulate_lengths(n, 2, 1, 0.2, longest, model)
    before = np.concatenate([y[:1], y[:-1]])
    pad = ((factor.size - 1, 0), (0, 0))
    return (
        np.ascontiguousarray(np.pad(np.concatenate([before, y], axis=1), pad).T),
        np.ascontiguousarray(np.pad(v, pad).T),
        factor,
        model.n_centres,
        model.bell_width,
        model.weight_variance,
        model.speed_weight_variance,
        model.noise_scale,
        model.nu(2),
        model.nu(1),
    )


@pytest.mark.parametrize(("n", "longest"), [(30, 8), (20, 20), (600, 9)])
def test_both_passes_are_sums_over_the_evidence(n, longest):
    model = VmciModel(n_centres=2)
    given = arguments(n, longest, model)
    evidence = np.empty((n, longest + 1))
    evaluate_block(*given[:2], 0, n, *given[2:], True, evidence)
    forward, backward = np.full(n + 1, -np.inf), np.full(n + 1, -np.inf)
    forward[0], backward[n] = -np.log(model.n_centres), 0.0
    for end in range(1, n + 1):
        lengths = np.arange(1, min(longest, end) + 1)
        forward[end] = logsumexp(forward[end - lengths] + evidence[end - 1, lengths])
    for start in range(n - 1, -1, -1):
        lengths = np.arange(1, min(longest, n - start) + 1)
        ends = start + lengths
        backward[start] = logsumexp(backward[ends] + evidence[ends - 1, lengths])
    found = run_forward_backward(*given)
    np.testing.assert_allclose(found[0], forward, rtol=1e-9)
    np.testing.assert_allclose(found[1], backward, rtol=1e-9)
    assert forward[n] == pytest.approx(forward[0] + backward[0])
