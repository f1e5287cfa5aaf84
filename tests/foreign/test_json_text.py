import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.foreign.json_text import DEEPEST, is_deep, parse_json

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=10,
)


@given(PLAIN)
def test_json_is_read_as_python_reads_it(content):
    text = json.dumps(content)
    assert parse_json(text) == content
    assert parse_json(text.encode()) == content


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "Expecting property name"),
        ("[NaN]", "NaN is no JSON"),
        ("[-Infinity]", "-Infinity is no JSON"),
        ("9" * 20, "an integer of 20 digits; expected at most 19"),
        (b"\xff", "expected text in UTF-8"),
        ("[" * 65 + "]" * 65, "lists and objects lie in each other more than 64 levels deep"),
        ("[" * 90_000, "lists and objects lie in each other more than 64 levels deep"),
    ],
)
def test_what_is_no_json_ends_in_one_kind_of_error(text, message):
    with pytest.raises(json.JSONDecodeError, match=message):
        parse_json(text)


def test_depth_is_that_of_the_deepest_branch():
    content = "end"
    for level in range(DEEPEST + 2):
        assert is_deep(content, DEEPEST) == (level > DEEPEST)
        content = [content, 1] if level % 2 else {"a": 1, "b": content}
