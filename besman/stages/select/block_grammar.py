"""Actions as sequences of blocks: found by a grammar, or within what is known of actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError, nearest
from besman.records import LabelledSegments
from besman.records.layers import IDLE

IntArray = npt.NDArray[np.int64]


class BlockRun(NamedTuple):
    """Blocks of one recording without rests, what was cut in two put together.

    Attributes
    ----------
    labels : tuple of str, length B
    bounds : int array, shape (B, 2)
        Half-open rows.
    """

    labels: tuple[str, ...]
    bounds: IntArray

    def take(self, start: int, stop: int) -> BlockRun:
        """Return blocks `start` to `stop` - 1."""
        return BlockRun(self.labels[start:stop], self.bounds[start:stop])


def join_blocks(found: LabelledSegments) -> BlockRun:
    """Leave out rests, and join pieces of one label that touch.

    Parameters
    ----------
    found : LabelledSegments
        Blocks of a recording.
    """
    labels: list[str] = []
    bounds: list[list[int]] = []
    order = np.lexsort((found.bounds[:, 1], found.bounds[:, 0]))
    for start, end, label in (
        (*found.bounds[k].tolist(), found.labels[k]) for k in order if found.labels[k] != IDLE
    ):
        if labels and label == labels[-1] and start <= bounds[-1][1] + 1:
            bounds[-1][1] = max(bounds[-1][1], end)
        else:
            labels.append(label)
            bounds.append([start, end])
    return BlockRun(tuple(labels), np.array(bounds, dtype=np.int64).reshape(-1, 2))


def find_sequence(blocks: BlockRun, sequence: Sequence[str]) -> list[BlockRun]:
    """Find where blocks follow each other as an action says, from the first on, none shared.

    Parameters
    ----------
    blocks : BlockRun
    sequence : sequence of str
        Labels of the action, at least one.
    """
    wanted, found, k = tuple(sequence), [], 0
    while k + len(wanted) <= len(blocks.labels):
        if blocks.labels[k : k + len(wanted)] == wanted:
            found.append(blocks.take(k, k + len(wanted)))
            k += len(wanted)
        else:
            k += 1
    return found


def find_beginning(blocks: BlockRun, sequence: Sequence[str]) -> int:
    """Return how many of an action's first blocks, not all, are the last ones of a recording.

    Parameters
    ----------
    blocks : BlockRun
    sequence : sequence of str
        Labels of the action.
    """
    wanted, labels = tuple(sequence), blocks.labels
    lengths = range(min(len(wanted) - 1, len(labels)), 0, -1)
    return next((n for n in lengths if labels[len(labels) - n :] == wanted[:n]), 0)


def blocks_within(blocks: BlockRun, start: int, end: int) -> BlockRun:
    """Return the blocks of which more than half lies within the half-open rows of an action."""
    shared = np.minimum(blocks.bounds[:, 1], end) - np.maximum(blocks.bounds[:, 0], start)
    inside = np.flatnonzero(2 * shared > blocks.bounds[:, 1] - blocks.bounds[:, 0])
    if not len(inside):
        return blocks.take(0, 0)
    return blocks.take(int(inside[0]), int(inside[-1]) + 1)


def check_grammar(grammar: Mapping[str, Sequence[str]], known: Sequence[str]) -> None:
    """Refuse an action with a block that no recording has.

    Parameters
    ----------
    grammar : mapping of str to sequence of str
        Blocks of each action.
    known : sequence of str
        Labels that there are.

    Raises
    ------
    MappingError
        Names the action, the block and the nearest label.
    """
    for action, sequence in grammar.items():
        for label in sequence:
            if label not in known:
                raise MappingError(
                    f"select.actions.{action}: no block is labelled {label!r}; "
                    f"{nearest(label, known)}"
                )
