import numpy as np

from besman.motion.forcing import DENSE, count_nodes, forcing_basis, quadrature, spring


def test_the_basis_functions_share_the_phase():
    x = np.linspace(0, 1, 40)
    for n_weights in (2, 20, 150):
        basis = forcing_basis(x, n_weights)
        assert basis.min() >= 0
        np.testing.assert_allclose(basis.sum(axis=1), 0.01**x)


def test_there_are_nodes_enough_for_every_weight():
    assert count_nodes(5) == count_nodes(DENSE) == 501
    assert all(count_nodes(n) > 4.9 * n for n in (101, 200, 333, 960))


def test_the_quadrature_integrates_what_decays():
    """The integral of exp(12.5 x) is known."""
    x, shares = quadrature(501)
    assert x.shape == shares.shape == (500, 6)
    np.testing.assert_allclose(shares.sum(), (np.exp(12.5) - 1) / 12.5, rtol=1e-12)
    np.testing.assert_allclose(spring(x).sum(axis=-1), 25 * 25 / 4)
