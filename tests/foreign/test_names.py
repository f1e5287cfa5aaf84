import pytest

from besman.foreign.names import LONGEST, fault_of_name


@pytest.mark.parametrize("name", ["Hand top", "épaule", "手", "a_1", "naïve ✓", ""])
def test_what_can_be_shown_is_a_name(name):
    assert fault_of_name(name) is None


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("a\x1b[31m", "has the control character U+001B"),
        ("a\nb", "has the control character U+000A"),
        ("a\u2028b", "has the control character U+2028"),
        ("a\u202eb", "has the control character U+202E"),
        ("\ud800", "has the control character U+D800"),
        ("a" * (LONGEST + 1), "has 201 characters, more than 200"),
    ],
)
def test_what_a_terminal_would_obey_is_none(name, fault):
    assert fault_of_name(name) == fault
    assert fault_of_name("a" * LONGEST) is None
