import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest

from besman.records.schema import check_fields


@dataclass
class Every:
    """A field of each kind."""

    name: str
    number: float
    count: int
    array: npt.NDArray[np.float64]
    rows: npt.NDArray[np.int64]
    pair: tuple[int, str]
    many: tuple[float, ...]
    kind: Literal["one", "two"]
    settings: dict[str, int]
    maybe: str | None = None
    anything: Any = None
    reason: str = ""


GOOD = {
    "name": "épaule",
    "number": 3,
    "count": 3,
    "array": np.zeros(2),
    "rows": np.array([1, 2]),
    "pair": (1, "a"),
    "many": (1.0, 2),
    "kind": "one",
    "settings": {"a": 1},
}


def test_values_of_the_right_kind_pass():
    check_fields(Every, GOOD)
    check_fields(Every, GOOD | {"maybe": "a", "anything": {1: 2}, "reason": "line\nline"})
    check_fields(Every, GOOD | {"array": np.array([1, 2]), "maybe": None})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"other": 1}, "Every has no field 'other'"),
        ({"name": 1}, "Every.name: got int 1, expected str"),
        ({"name": "a\x1b"}, "Every.name: 'a\\x1b' has the control character U+001B"),
        ({"count": 1.0}, "Every.count: got float 1.0, expected int"),
        ({"count": True}, "Every.count: got bool True, expected int"),
        ({"array": [1.0]}, "Every.array: got list [1.0], expected an array"),
        ({"array": np.array(["a"])}, "Every.array: got an array of <U1, expected float64"),
        ({"array": np.array([np.inf])}, "Every.array: got an array with infinite numbers"),
        ({"rows": np.array([1.5])}, "Every.rows: got an array of float64, expected int64"),
        ({"pair": (1,)}, "Every.pair: got 1 entries, expected 2"),
        ({"pair": (1, 2)}, "Every.pair[1]: got int 2, expected str"),
        ({"many": [1.0]}, "Every.many: got list [1.0], expected a tuple"),
        ({"kind": "three"}, "Every.kind: got 'three', expected one of ('one', 'two')"),
        ({"settings": {"a": "b"}}, "Every.settings['a']: got str 'b', expected int"),
        ({"settings": []}, "Every.settings: got list [], expected a dict"),
        ({"maybe": 1}, "Every.maybe: got int 1, expected str or None"),
    ],
)
def test_any_other_value_is_named_with_its_place(change, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        check_fields(Every, GOOD | change)


def test_a_field_that_is_missing_is_named():
    with pytest.raises(ValueError, match=re.escape("Every.many is missing")):
        check_fields(Every, {name: value for name, value in GOOD.items() if name != "many"})
