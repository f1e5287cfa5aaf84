import numpy as np
import pytest

from besman.geometry import row_blocks
from besman.geometry.row_blocks import by_rows, measure_apart


@pytest.mark.parametrize("n_rows", [0, 1, 7, 8, 23])
def test_blocks_give_the_bits_of_the_whole(n_rows, monkeypatch):
    monkeypatch.setattr(row_blocks, "_ROWS", 7)
    one, two = np.random.default_rng(0).normal(size=(2, n_rows, 3))
    expected = np.linalg.norm(one - two, axis=1)
    assert measure_apart(one, two).tobytes() == expected.tobytes()
    crossed = by_rows(np.cross, one, two)
    assert crossed.tobytes() == np.cross(one, two).tobytes()
    assert by_rows(lambda some: some[:, 0] > 0, one).dtype == bool
