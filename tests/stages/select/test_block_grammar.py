import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.exceptions import MappingError
from besman.records import LabelledSegments
from besman.records.layers import IDLE
from besman.stages.select.block_grammar import (
    BlockRun,
    blocks_within,
    check_grammar,
    find_sequence,
    join_blocks,
)


def blocks(*labels):
    """Blocks of ten rows each, one after the other."""
    starts = 10 * np.arange(len(labels))
    bounds = np.stack([starts, starts + 10], axis=1)
    return LabelledSegments(bounds, labels, np.zeros(len(labels)), 60.0, "a.tsv")


def test_rests_go_and_what_was_cut_in_two_is_joined():
    joined = join_blocks(blocks("a", "a", IDLE, "b", IDLE, "b", "b", "c"))
    assert joined.labels == ("a", "b", "b", "c")
    assert joined.bounds.tolist() == [[0, 20], [30, 40], [50, 70], [70, 80]]
    assert join_blocks(blocks(IDLE)).labels == ()


@given(st.text("abc", max_size=12), st.text("abc", min_size=1, max_size=3))
def test_sequences_are_found_as_text_is(text, wanted):
    """No label follows itself in joined blocks, so that text without doubles is the same."""
    run = join_blocks(blocks(*text))
    letters = "".join(run.labels)
    found = find_sequence(run, wanted)
    assert len(found) == letters.count(wanted)
    assert all("".join(one.labels) == wanted for one in found)
    starts = [one.bounds[0, 0] for one in found]
    assert starts == sorted(starts)


def test_what_is_unknown_ends_a_sequence():
    assert find_sequence(join_blocks(blocks("a", "unknown", "b")), ("a", "b")) == []


@pytest.mark.parametrize(
    ("start", "end", "expected"), [(0, 40, "abcd"), (4, 24, "ab"), (6, 26, "bc"), (90, 99, "")]
)
def test_blocks_of_an_action_are_those_most_of_which_lie_in_it(start, end, expected):
    assert "".join(blocks_within(join_blocks(blocks(*"abcd")), start, end).labels) == expected


def test_half_a_block_is_not_most_of_it():
    run = BlockRun(("a",), np.array([[0, 10]]))
    assert blocks_within(run, 5, 20).labels == ()


def test_a_misspelt_block_is_named_with_the_nearest():
    check_grammar({"tidy": ["reach", "put"]}, ["put", "reach"])
    with pytest.raises(
        MappingError, match=r"select.actions.tidy: no block is labelled 'raech'; .*reach"
    ):
        check_grammar({"tidy": ["raech"]}, ["put", "reach"])
