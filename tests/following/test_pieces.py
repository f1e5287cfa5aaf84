"""What changed about pieces, against a replay that knows all pieces at every moment."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from besman.following.pieces import Ledger, Piece


def block(start, end, label="a", final=False):
    return Piece("block", "right", start, end, label, 0.5, final)


def told(changes):
    return [(one.status, one.piece.start, one.piece.end, one.piece.label) for one in changes]


def test_new_changed_final_and_gone():
    ledger = Ledger()
    assert told(ledger.update([block(0, 10), block(10, 20)])) == [
        ("new", 0, 10, "a"), ("new", 10, 20, "a"),
    ]  # fmt: skip
    assert ledger.update([block(0, 10), block(10, 20)]) == []
    changes = ledger.update([block(0, 10, "b"), block(10, 23)])
    assert told(changes) == [("changed", 0, 10, "b"), ("changed", 10, 23, "a")]
    assert changes[1].before == block(10, 20)
    assert told(ledger.update([block(0, 10, "b", final=True), block(10, 23)])) == [
        ("final", 0, 10, "b")
    ]
    # Less than half in common: another piece.
    assert told(ledger.update([block(10, 14), block(14, 18)])) == [
        ("gone", 10, 23, "a"), ("new", 10, 14, "a"), ("new", 14, 18, "a"),
    ]  # fmt: skip
    assert ledger.n_final == 1
    assert [one.end for one in ledger.pieces] == [10, 14, 18]


def test_who_hears_of_all_changes_knows_all_pieces():
    random = np.random.default_rng(0)
    ledger, known, n_final = Ledger(), {}, 0
    for _ in range(200):
        start = max((one.end for one in known.values() if one.final), default=0)
        rows = [start, *np.unique(random.integers(start + 1, start + 40, 4)).tolist()]
        pieces = [block(*pair, label=str(random.integers(3))) for pair in pairwise(rows)]
        if random.random() < 0.1:
            pieces[0] = replace(pieces[0], final=True)
            n_final += 1
        for change in ledger.update(pieces):
            if change.before is not None:
                del known[change.before.start, change.before.end]
            if change.status != "gone":
                known[change.piece.start, change.piece.end] = change.piece
        assert sorted(known) == sorted((one.start, one.end) for one in ledger.pieces)
        assert set(known.values()) == set(ledger.pieces)
    assert ledger.n_final == n_final > 5
