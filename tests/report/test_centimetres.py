import math

import pytest

from besman.report.centimetres import centimetres


@pytest.mark.parametrize(
    ("metres", "said"),
    [(0.0123, "1.2 cm"), (-1.5, "-150.0 cm"), (0.0, "0.0 cm"), (None, "?"), (math.nan, "?")],
)
def test_a_distance_is_written_in_centimetres_or_as_unknown(metres, said):
    assert centimetres(metres, "?") == said
    assert centimetres(math.inf) == "-"
