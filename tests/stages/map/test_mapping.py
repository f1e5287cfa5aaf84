import numpy as np
import pytest

from besman.records import Failure, ShapeError
from besman.records.files import load_record, save_record
from besman.stages.map.mapping import Correction, Mapping


def test_a_mapping_keeps_its_placement_from_being_changed(tmp_path):
    placement = np.eye(4)
    mapping = Mapping((), placement, (Failure("a", "no"),), {"reach": 0.5}, 0, 0,
                      corrected=(Correction("b", "far", 0.1, 0.2, 1.0),))  # fmt: skip
    placement[0, 3] = 9.0
    assert mapping.placement[0, 3] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mapping.placement[0, 3] = 1.0
    save_record(mapping, tmp_path / "a.npz")
    again = load_record(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.placement, mapping.placement)
    assert (again.failed, again.corrected, again.terms) == (
        mapping.failed, mapping.corrected, mapping.terms,
    )  # fmt: skip


def test_a_placement_is_a_pose():
    with pytest.raises(ShapeError, match="placement"):
        Mapping((), np.eye(3), (), {}, 0, 0)
