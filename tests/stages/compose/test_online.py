"""Actions while blocks arrive, against the whole recording at once."""

import dataclasses
import itertools

import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.stages.compose.actions import compose_levels, train_level
from besman.stages.compose.borders import merge_borders
from besman.stages.compose.online import OnlineHierarchy

ARM = ("hand_top", "elbow", "shoulder")


@pytest.fixture(scope="module")
def models(lesson):
    recording, _, actions = lesson
    both = [(0, actions.bounds[1, 1]), (actions.bounds[2, 0], actions.bounds[3, 1])]
    return [
        train_level([recording], [actions.bounds], [actions.labels], ARM),
        train_level([recording], [both], [["round", "round"]], ARM),
    ]


def pieces(recording, borders):
    """Cut a recording at borders."""
    for start, end in itertools.pairwise(borders):
        yield dataclasses.replace(
            recording,
            time=recording.time[start:end],
            positions=recording.positions[start:end],
            filled=recording.filled[start:end],
            first_frame=int(recording.first_frame + start),
        )


def test_every_moment_equals_the_whole_so_far(steps, models):
    recording, blocks, _ = steps
    borders = merge_borders([blocks.bounds])
    online = OnlineHierarchy(models)
    for n, piece in enumerate(pieces(recording, borders), start=1):
        current = online.update(piece)
        offline = compose_levels(recording, borders[: n + 1], models)
        for one, two in zip(current, offline, strict=True):
            assert one.borders.tolist() == two.borders.tolist()
            assert one.labels == two.labels
            assert one.fitness == pytest.approx(two.fitness, abs=1e-12)
            assert one.n_final == 0


def test_with_a_horizon_actions_become_final_and_stay(steps, models):
    recording, blocks, actions = steps
    borders = merge_borders([blocks.bounds])
    online = OnlineHierarchy(models, longest=8, horizon=6)
    before = [(), ()]
    for piece in pieces(recording, borders):
        current = online.update(piece)
        for index, level in enumerate(current):
            final = tuple(zip(level.borders[: level.n_final], level.labels, strict=False))
            assert final[: len(before[index])] == before[index]
            before[index] = final
    assert len(before[0]) >= 4
    offline = compose_levels(recording, borders, models, longest=8)
    assert [level.labels for level in current] == [level.labels for level in offline]
    assert current[0].labels == actions.labels


def test_samples_of_final_actions_are_dropped(steps, models):
    recording, blocks, _ = steps
    online = OnlineHierarchy(models[:1], longest=8, horizon=6)
    for piece in pieces(recording, merge_borders([blocks.bounds])):
        online.update(piece)
    assert len(online._seen.time) < 0.6 * len(recording.time)


def test_bad_input(steps, models):
    recording = steps[0]
    with pytest.raises(RecognitionError, match="got no levels"):
        OnlineHierarchy([])
    online = OnlineHierarchy(models)
    first, second = pieces(recording, [0, 30, 60])
    online.update(first)
    with pytest.raises(RecognitionError, match="expected those of the blocks before"):
        online.update(dataclasses.replace(second, markers=("x", *second.markers[1:])))
    with pytest.raises(RecognitionError, match="a block begins at 0 s; expected it after"):
        online.update(first)
    unseen = dataclasses.replace(second, positions=np.full_like(second.positions, np.nan))
    with pytest.raises(RecognitionError, match="was not seen in frame"):
        online.update(unseen)
