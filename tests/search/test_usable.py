import numpy as np

from besman.search.usable import usable


def test_only_episodes_whose_every_return_is_finite_can_be_learnt_from():
    values = [1.0, np.nan, -np.inf, -3.0, np.inf]
    assert usable(values).tolist() == [True, False, False, True, False]
    moments = np.zeros((5, 3))
    moments[:, 1] = values
    assert usable(moments).tolist() == usable(values).tolist()
