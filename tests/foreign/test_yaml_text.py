from itertools import pairwise

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from besman.foreign.yaml_text import YamlTextError, parse_yaml

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**62), 2**62) | st.text("abc: -#'", max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner),
    max_leaves=8,
)


@given(PLAIN)
def test_plain_values_are_read_as_they_were_written(content):
    assert parse_yaml(yaml.safe_dump(content))[0] == content


def test_a_date_is_text_and_nothing_is_none():
    assert parse_yaml("day: 2026-11-29")[0] == {"day": "2026-11-29"}
    assert parse_yaml("")[:2] == (None, None)


BILLIONS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join(9 * [f'*{old}'])}]\n" for old, new in pairwise("abcdef")
)


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("a: 1\nb: !!python/object:os.system x", "a value of the kind 'os.system'", 2),
        ("a:\n- !!binary aGk=", "a value of the kind 'binary'", 2),
        ("a: " + "9" * 21, "an integer of 21 digits", 1),
        ("[" * 65 + "]" * 65, "more than 64 levels deep", 1),
        (BILLIONS, "more than 100000 values, with those that aliases repeat", 0),
        ("a: &a\n  b: *a", "an alias inside of what it stands for", 1),
        ("a: 1\n[1, 2]: 3", "a key that is a list or mapping; expected a word", 2),
        ("a: [1", "expected ',' or ']'", 1),
    ],
)
def test_what_is_refused_says_where(text, message, line):
    with pytest.raises(YamlTextError, match=message) as error:
        parse_yaml(text)
    assert error.value.line == line
