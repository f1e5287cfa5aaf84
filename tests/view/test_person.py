import dataclasses

import numpy as np
import pytest
from people import ARM, BACK, person
from scipy.spatial.transform import Rotation

from besman.view.packing import Packer
from besman.view.person import find_person

NAMES = [*BACK, *ARM, "box_back"]


@pytest.fixture(scope="module")
def recording():
    return person("a.tsv", 0, NAMES, ARM[2:])[0]


def test_markers_are_seen_from_the_floor_below_the_back(recording):
    found = find_person(recording, (60, 90), "box_back", 25.0)
    assert found.names == tuple(NAMES)
    assert found.interval_s == pytest.approx(2 / recording.rate_hz)
    row = round(-found.start_s / found.interval_s)
    height = found.markers[..., 2]
    rows = 60 + 2 * np.arange(-row, len(found.markers) - row)
    np.testing.assert_allclose(height, recording.positions[rows][..., 2], atol=1e-9)
    back = found.markers[row, :3]
    np.testing.assert_allclose(back.mean(axis=0)[:2], 0, atol=0.01)
    assert found.back_height_m == pytest.approx(recording.positions[60, :3, 2].mean(), abs=0.1)
    assert found.on_floor
    assert NAMES[found.thrown] == "box_back"
    assert [NAMES[k] for k in found.limbs[0]] == ["back_top", "shoulder", "elbow", "hand_top"]
    assert {NAMES[k] for k in found.patches[0]} == set(BACK)


def test_where_the_person_stands_and_faces_does_not_matter(recording):
    turn = Rotation.from_euler("Z", 50, degrees=True).as_matrix()
    moved = dataclasses.replace(recording, positions=recording.positions @ turn.T + [1.0, 2.0, 0])
    one, other = (find_person(r, (60, 90), None, 25.0) for r in (recording, moved))
    np.testing.assert_allclose(one.markers, other.markers, atol=1e-9)


def test_without_a_back_they_stay_in_the_laboratory(recording):
    columns = [NAMES.index(name) for name in ("elbow", "box_back")]
    bare = dataclasses.replace(
        recording, positions=recording.positions[:, columns], markers=("elbow", "box_back"),
        filled=recording.filled[:, columns],
    )  # fmt: skip
    found = find_person(bare, (0, 30), None, recording.rate_hz)
    assert found.start_s == 0.0
    np.testing.assert_array_equal(found.markers[:30], bare.positions[:30])
    assert (found.limbs, found.patches, found.thrown, found.on_floor) == ([], [], -1, False)


def test_a_page_is_given_everything_by_name(recording):
    content = find_person(recording, (60, 90), "box_back", 25.0).content(Packer())
    assert set(content) == {
        "names", "start", "interval", "limbs", "patches", "thrown", "onFloor", "markers",
    }  # fmt: skip
