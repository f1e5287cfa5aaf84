import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.foreign.numbers import has_odd_digits, parse_number, parse_whole_number


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_python_writes_is_read_to_the_last_bit(value):
    assert parse_number(f" {value!r}\r\n") == value


@given(st.integers(-(10**15) + 1, 10**15 - 1))
def test_whole_numbers_are_read(value):
    assert parse_whole_number(f"{value:+d}") == value


@given(st.text(alphabet="0123456789+-.eE_ ²\u0661inf", max_size=8))
def test_nothing_is_read_that_python_does_not_read_alike(text):
    try:
        value = parse_number(text)
    except ValueError:
        return
    assert value == float(text)
    assert not has_odd_digits(text)


@pytest.mark.parametrize(
    "text", ["1_000", "²", "\u0661", "nan", "inf", "", ".", "1e", "0x1", "1 2"]
)
def test_what_only_python_takes_for_a_number_is_none(text):
    with pytest.raises(ValueError, match=f"{re.escape(repr(text))} is no decimal number"):
        parse_number(text)


@pytest.mark.parametrize("text", ["1.0", "1_0", "9" * 16, "", "-"])
def test_whole_numbers_are_short(text):
    with pytest.raises(ValueError, match="is no whole number of at most 15 digits"):
        parse_whole_number(text)


def test_odd_digits():
    assert has_odd_digits("1_000")
    assert has_odd_digits("\u0661")
    assert not has_odd_digits("-1.5e3\t7")
