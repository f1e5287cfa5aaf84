"""One second teaches what the rest is called."""

import numpy as np
import pytest
from places import REAL_DATA

from besman.evaluation.one_second import name_by_one_second
from besman.io.recordings.formats import read_recording

needs_real = pytest.mark.skipif(
    not REAL_DATA.is_dir(), reason="the real recordings are not on this machine"
)


@needs_real
@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_a_whole_body_is_named_by_one_second_of_its_recording():
    take = read_recording(REAL_DATA / "c3d" / "KneeltoProne01.c3d")
    found = name_by_one_second(take.positions, take.rate_hz, take.names, n_stretches=2)
    assert found["right_share"] >= 0.97
    assert found["wrong_share"] <= 0.003
    assert 0.97 < sum(row["share"] for row in found["bins"]) <= 1.0
    assert found["bins"][-1]["right_share"] >= 0.997


def test_shares_are_of_all_samples_seen():
    rng = np.random.default_rng(0)
    body = rng.normal(scale=0.2, size=(6, 3))
    walk = np.cumsum(rng.normal(scale=0.003, size=(400, 1, 3)), axis=0)
    positions = body + walk
    positions[100:150, 2] = np.nan
    found = name_by_one_second(positions, 100.0, tuple("abcdef"), n_stretches=2)
    assert found["n_stretches"] == 2
    assert found["right_share"] == pytest.approx(1.0)
    assert found["wrong_share"] == 0.0
    sure = found["bins"][-1]
    assert (sure["from"], sure["to"], sure["right_share"]) == (0.99, 1.0, 1.0)
    assert all(row["right_share"] is None for row in found["bins"] if not row["share"])
