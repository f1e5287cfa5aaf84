"""Actions of known steps, and everything that cannot be composed."""

import dataclasses
import itertools

import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.records import LabelledSegments
from besman.stages.compose.actions import (
    compose_level,
    compose_levels,
    cut_paths,
    name_spans,
    train_level,
)
from besman.stages.compose.borders import candidate_borders, find_slow_rows, merge_borders
from besman.stages.compose.stage import (
    ComposeConfig,
    compose_results,
    leave_out_actions,
    pick_level,
)

ARM = ("hand_top", "elbow", "shoulder")


def learn(lesson, markers=ARM):
    recording, _, actions = lesson
    return train_level([recording], [actions.bounds], [actions.labels], markers)


def test_finds_the_actions(steps, lesson):
    recording, blocks, actions = steps
    level = compose_level(recording, merge_borders([blocks.bounds]), learn(lesson))
    assert level.labels == actions.labels
    assert level.borders.tolist() == [0, *actions.bounds[:, 1]]
    assert level.fitness == pytest.approx(-level.uncertainties.mean())


def test_is_the_best_of_all_groupings(steps, lesson):
    recording, blocks, _ = steps
    borders = merge_borders([blocks.bounds])[:9]
    model = learn(lesson)
    best = min(
        np.mean(name_spans(recording, list(itertools.pairwise(chosen)), model)[1])
        for size in range(8)
        for inner in itertools.combinations(borders[1:-1], size)
        for chosen in [(borders[0], *inner, borders[-1])]
    )
    assert compose_level(recording, borders, model).fitness == pytest.approx(-best, abs=1e-12)


def test_over_segmented_blocks_are_merged(steps, lesson):
    recording, blocks, actions = steps
    halves = blocks.bounds.mean(axis=1).astype(int)
    level = compose_level(recording, merge_borders([blocks.bounds, halves]), learn(lesson))
    assert level.labels == actions.labels
    assert level.borders[1:].tolist() == actions.bounds[:, 1].tolist()


def test_higher_levels_are_made_of_lower_ones(steps, lesson):
    recording, blocks, actions = steps
    both = train_level([lesson[0]], [[(0, lesson[2].bounds[1, 1])]], [["round"]], ARM)
    levels = compose_levels(recording, merge_borders([blocks.bounds]), [learn(lesson), both])
    assert levels[1].labels == ("round",) * 3
    assert set(levels[1].borders) <= set(levels[0].borders)
    assert levels[1].borders[1:].tolist() == actions.bounds[1::2, 1].tolist()


def test_two_arms_share_their_borders(steps, make_steps):
    one, blocks, actions = steps
    other, other_blocks, _ = make_steps(["step_up", "step_down"] * 3, seed=1, prefix="left_")
    recording = dataclasses.replace(
        one,
        positions=np.concatenate([one.positions, other.positions[:, 3:]], axis=1),
        markers=(*one.markers, *other.markers[3:]),
        filled=np.concatenate([one.filled, other.filled[:, 3:]], axis=1),
    )
    shifted = np.clip(other_blocks.bounds + 7, 0, len(one.time))
    borders = merge_borders([blocks.bounds, shifted])
    assert len(borders) > len(blocks.bounds) + 1
    markers = (*ARM, *(f"left_{name}" for name in ARM))
    model = train_level([recording], [actions.bounds[:4]], [actions.labels[:4]], markers)
    assert compose_level(recording, borders, model).labels == actions.labels


def test_valleys_bring_back_a_missed_border(steps, lesson):
    recording, blocks, actions = steps
    missed = np.delete(blocks.bounds[:, 1], 3)
    bounds = np.stack([np.append(0, missed[:-1]), missed], axis=1)
    without = compose_level(recording, candidate_borders(recording, [bounds], ()), learn(lesson))
    borders = candidate_borders(recording, [bounds], ("hand_top",))
    level = compose_level(recording, borders, learn(lesson))
    assert actions.bounds[0, 1] not in without.borders
    assert level.labels == actions.labels
    assert np.abs(level.borders[1:] - actions.bounds[:, 1]).max() <= 2


def test_valleys_of_a_rest_are_its_ends(make_steps):
    recording, _, _ = make_steps(["step_up"])
    hand = recording.positions.copy()
    still = np.repeat(hand[-1:], 50, axis=0)
    longer = dataclasses.replace(
        recording,
        time=np.arange(len(hand) + 100) / recording.rate_hz,
        positions=np.concatenate([hand, still, hand[::-1][:50]]),
        filled=np.zeros((len(hand) + 100, 6), dtype=bool),
    )
    rows = find_slow_rows(longer, "hand_top")
    inside = rows[(rows > len(hand) - 15) & (rows < len(hand) + 60)]
    assert len(inside) == 2
    assert np.abs(inside - [len(hand), len(hand) + 50]).max() <= 8


def test_paths_do_not_depend_on_where_the_person_stands(steps):
    recording = steps[0]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = dataclasses.replace(recording, positions=recording.positions @ turn.T + [3.0, 1.0, 0.0])
    spans = [(0, 40), (10, 90)]
    one, two = (cut_paths(r, spans, ARM, 10) for r in (recording, moved))
    np.testing.assert_allclose(one, two, atol=1e-9)


def test_paths_pass_through_first_and_last_sample(steps):
    recording = dataclasses.replace(steps[0], markers=("a", "b", "c", *ARM))
    cut = cut_paths(recording, [(5, 30)], ("hand_top",), 25)[0]
    np.testing.assert_allclose(cut, recording.marker("hand_top")[5:30], atol=1e-12)


def test_one_block(steps, lesson):
    level = compose_level(steps[0], [0, 100], learn(lesson))
    assert len(level.labels) == 1


def gap(recording):
    positions = recording.positions.copy()
    positions[20, 3] = np.nan
    return dataclasses.replace(recording, positions=positions)


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda r, m: compose_level(r, [0], m), "got no blocks"),
        (lambda r, m: compose_levels(r, [0, 50], []), "got no levels"),
        (lambda r, m: compose_level(r, [0, 1, 50], m), r"segment \[0, 1\); expected at least 2"),
        (lambda r, m: compose_level(r, [0, 10**6], m), "expected at least 2 samples inside"),
        (lambda r, m: compose_level(gap(r), [0, 50], m), "'hand_top' was not seen in frame 21"),
        (lambda r, m: find_slow_rows(gap(r), "hand_top"), "'hand_top' was not seen in frame 21"),
        (lambda r, m: train_level([r], [[]], [[]], ARM), "a level has no examples"),
        (lambda r, m: train_level([r], [[(0, 9)]], [["a"]], ("elbwo",)), "did you mean 'elbow'"),
        (lambda r, m: merge_borders([[]]), "got no blocks"),
    ],
)
def test_bad_input(steps, lesson, run, message):
    with pytest.raises(RecognitionError, match=message):
        run(steps[0], learn(lesson))


def both_layers(one):
    """Put blocks and actions in one record, as a segments file does."""
    _, blocks, actions = one
    return LabelledSegments(
        np.concatenate([blocks.bounds, actions.bounds]),
        blocks.labels + actions.labels,
        np.zeros(len(blocks.labels) + len(actions.labels)),
        blocks.rate_hz,
        blocks.source,
    )


def test_stage(steps, lesson):
    config = ComposeConfig(levels=(("step_up", "step_down"),), examples_per_class=2)
    models = config.train((lesson[0],), (both_layers(lesson),))
    found = config.run((steps[0],), (steps[1],), models)
    assert found[0].levels[0].labels == steps[2].labels
    assert pick_level(found, config, "step_up")[0].labels == steps[2].labels
    assert compose_results(found)["levels"][0]["counts"] == {"step_down": 3, "step_up": 3}
    assert compose_results(found)["levels"][0]["fitness"] == pytest.approx(found[0].fitness[0])


def test_blocks_are_what_holds_no_other_segment(lesson):
    config = ComposeConfig(levels=(("step_up", "step_down"),))
    (blocks,) = leave_out_actions((both_layers(lesson),), config)
    assert blocks.labels == lesson[1].labels
    (same,) = leave_out_actions((lesson[2],), config)
    assert same.labels == lesson[2].labels
    assert leave_out_actions((None,), config) == (None,)
    assert leave_out_actions((lesson[2],), None) == (lesson[2],)


def test_stage_refuses(steps, lesson):
    config = ComposeConfig(levels=(("step_up", "turn"),))
    with pytest.raises(RecognitionError, match="class 'turn' has no labelled examples"):
        config.train((lesson[0],), (both_layers(lesson),))
    with pytest.raises(RecognitionError, match=r"'lesson\.tsv' have no recording"):
        config.train((steps[0],), (both_layers(lesson),))
    with pytest.raises(RecognitionError, match="no action 'step_upp'; did you mean 'step_up'"):
        config.check_action("step_upp")
    for levels, message in (
        ((), "at least 1 item"),
        (((),), "at least 1 item"),
        ((("a",), ("a",)), "'a' is listed twice"),
    ):
        with pytest.raises(ValueError, match=message):
            ComposeConfig(levels=levels)
