"""Keypoints that stand in an order of their system's own."""

import json

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording
from besman.io.recordings.keypoint_orders import ORDERS, UNSEEN, unfold


@pytest.mark.parametrize("key", ORDERS)
def test_a_list_is_four_numbers_a_keypoint(key):
    names = ORDERS[key]
    assert len(set(names)) == len(names)
    values = np.arange(4.0 * len(names))
    values[3] = 0.0
    found = dict(unfold(key, values.tolist(), "Ann:"))
    assert list(found) == [f"Ann:{one}" for one in names]
    assert found[f"Ann:{names[0]}"] == UNSEEN
    assert found[f"Ann:{names[2]}"] == [8.0, 9.0, 10.0]
    assert dict(unfold(key, [1.0, 2.0], "Ann:")) == {f"Ann:{key}": [1.0, 2.0]}
    assert dict(unfold(key, [], "")) == {}


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_lists_without_names_have_an_order_of_their_own(tmp_path):
    """CMU Panoptic's: neck, nose, middle of the hips, left arm; y down, cm."""
    body = np.tile([[0.0, -150.0, 10.0, 0.8]], (19, 1))
    body[[8, 14], 1], body[1, 1], body[9, 3] = 0.0, -170.0, -1.0
    bodies = [{"id": 3, "joints19": body.ravel().tolist()}]
    path = tmp_path / "a.jsonl"
    lines = [json.dumps({"univTime": 53541.5 + 33.33 * at, "bodies": bodies}) for at in range(9)]
    path.write_text(lines[0])
    with pytest.raises(RecordingError, match=r"one frame; .*of its own, give their folder"):
        read_recording(path)
    path.write_text("\n".join(lines))
    found = read_recording(path)
    assert found.rate_hz == 30.0
    assert found.names[:3] == ("person3:Neck", "person3:Nose", "person3:MidHip")
    assert np.isnan(found.positions[:, found.names.index("person3:RShoulder")]).all()
    nose, ankle = (
        found.positions[0, found.names.index(f"person3:{one}")] for one in ("Nose", "LAnkle")
    )
    np.testing.assert_allclose(nose - ankle, [0.0, 0.0, 1.7])
