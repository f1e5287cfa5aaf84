"""Foreseeing blocks: against the recognition's features, brute force, and a stream."""

import dataclasses

import numpy as np
import pytest
from steps import ACTIONS, step_recording

from besman.exceptions import RecognitionError
from besman.following.arms import FollowedArm
from besman.following.beginnings import (
    N_POINTS,
    SHARES,
    Beginnings,
    Example,
    FirstParts,
    end_rows,
)
from besman.following.files import describe_forecast
from besman.following.follower import Follower
from besman.following.foreseeing import BlockForecast, BlockForeseer
from besman.following.foresight import Foresight
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import IDLE
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.stage import VmciOnlineConfig

TRAIN = [
    step_recording(["step_up", "step_down"] * 2, seed, f"person_{seed}.tsv") for seed in (0, 1)
]
RECORDINGS = [recording for recording, _, _ in TRAIN]
BLOCKS = [blocks for _, blocks, _ in TRAIN]
RECIPE = RecognizeConfig().make_recipe(RECORDINGS, [1])


@pytest.fixture(scope="module")
def foresight():
    return Foresight(RECORDINGS, BLOCKS, RECIPE)


def test_features_of_a_first_part_are_those_of_the_recognition():
    recording = RECORDINGS[0]
    parts = FirstParts(RECIPE, recording.markers, recording.source)
    # As many samples as make every point one of them: nothing is interpolated then.
    n = 1 + 2 * (N_POINTS - 1)
    recipe = dataclasses.replace(RECIPE, features=parts.features, n_points=N_POINTS)
    np.testing.assert_allclose(
        parts.extract(recording.positions[40 : 40 + n], recording.rate_hz),
        recipe.extract(recording, [[40, 40 + n]])[0],
        atol=1e-9,
    )


def test_a_hands_orientation_is_not_looked_at():
    recording = RECORDINGS[0]
    for features, expected in (
        (("positions", "hand_orientation"), ("positions",)),
        (("hand_orientation",), ("displacements",)),
    ):
        recipe = dataclasses.replace(RECIPE, features=features)
        parts = FirstParts(recipe, recording.markers, recording.source)
        assert parts.features == expected
        assert np.isfinite(parts.extract(recording.positions[:20], recording.rate_hz)).all()


def test_of_recordings_with_one_name_the_first_counts(foresight):
    other = dataclasses.replace(RECORDINGS[1], source=RECORDINGS[0].source)
    again = Foresight([*RECORDINGS, other], BLOCKS, RECIPE)
    seen = foresight.parts(other.markers, "a").extract(other.positions[:20], other.rate_hz)
    found, expected = (one.weigh(one.expect([]), seen).now for one in (again, foresight))
    np.testing.assert_array_equal(found, expected)


def test_what_cannot_be_seen_has_no_features():
    recording = RECORDINGS[0]
    parts = FirstParts(RECIPE, recording.markers, recording.source)
    assert parts.extract(recording.positions[:2], recording.rate_hz) is None
    hidden = recording.positions[:20].copy()
    hidden[:, recording.markers.index("elbow")] = np.nan
    assert parts.extract(hidden, recording.rate_hz) is None
    in_line = recording.positions[:20].copy()
    in_line[:, :3] = in_line[:, :1]
    assert parts.extract(in_line, recording.rate_hz) is None


def test_the_end_of_a_movement_is_as_fast_as_its_fastest_hand():
    recording = RECORDINGS[0]
    parts = FirstParts(RECIPE, recording.markers, recording.source)
    n = end_rows(recording.rate_hz)
    positions = np.repeat(recording.positions[:1], n + 2, axis=0)
    # What was before does not count.
    positions[:2] += 1.0
    hand = recording.markers.index("hand_top")
    positions[:, hand] += np.arange(n + 2)[:, None] * [0.003, 0.0, 0.004]
    speed = parts.end_speed(positions, recording.rate_hz)
    assert speed == pytest.approx(0.005 * recording.rate_hz)
    assert np.isnan(parts.end_speed(positions[: n - 1], recording.rate_hz))
    positions[-1, hand] = np.nan
    assert np.isnan(parts.end_speed(positions, recording.rate_hz))


def test_a_forecast_knows_how_fast_the_last_block_ended(foresight, monkeypatch):
    recording, blocks, _ = step_recording(["step_up"], 5, "new.tsv")
    rate_hz = recording.rate_hz
    given = []
    expect = foresight.expect
    monkeypatch.setattr(foresight, "expect", lambda *asked: given.append(asked) or expect(*asked))
    first = (*blocks.bounds[0].tolist(), blocks.labels[0])
    end, now = first[1], first[1] + 4
    for ahead in (end, end - end_rows(rate_hz)):
        foreseer = BlockForeseer("right", foresight, recording.markers, rate_hz, "new.tsv")
        foreseer.update([first], now, recording.positions[ahead:now], ahead)
    parts = foresight.parts(recording.markers, "new.tsv")
    (_, unknown), (_, known) = given
    assert np.isnan(unknown)
    assert known == parts.end_speed(recording.positions[:end], rate_hz)


def test_densities_are_means_over_the_first_parts_of_the_examples():
    blocks, recording = BLOCKS[0], RECORDINGS[0]
    examples = [
        Example(recording, tuple(rows), label)
        for rows, label in zip(blocks.bounds.tolist(), blocks.labels, strict=True)
    ]
    beginnings = Beginnings(examples, RECIPE)
    parts = FirstParts(RECIPE, recording.markers, recording.source)
    rate_hz = recording.rate_hz
    every = {label: [] for label in beginnings.labels}
    for _, (start, end), label in examples:
        for share in SHARES:
            cut = recording.positions[start : start + max(3, round(share * (end - start)))]
            every[label].append(parts.extract(cut, rate_hz))
    values = np.concatenate([np.stack(own) for own in every.values()])
    # Each feature's channels together have one spread.
    centre, spread, first = values.mean(axis=(0, 1)), [], 0
    for width in parts.widths:
        channels = slice(first, first + width)
        apart = values[..., channels] - centre[channels]
        spread += [np.sqrt((apart**2).mean(axis=(0, 1)).sum())] * width
        first += width
    told = parts.extract(RECORDINGS[1].positions[:20], rate_hz)
    for found, own in zip(beginnings.log_densities(told), every.values(), strict=True):
        d2 = np.mean(((np.stack(own) - told) / spread) ** 2, axis=(1, 2))
        expected = np.log(np.mean(np.exp(-beginnings.sharpness * d2)))
        assert found == pytest.approx(expected, rel=1e-6)
    assert beginnings.log_densities(told[:, :-1]) is None


def test_the_order_tells_a_block_before_it_begins_and_its_first_part_after(foresight):
    recording, blocks, _ = step_recording(["step_up", "step_down", "step_up"], 9, "new.tsv")
    parts = foresight.parts(recording.markers, recording.source)
    for k in range(4, len(blocks.labels)):
        expected = foresight.expect(blocks.labels[:k])
        start, end = blocks.bounds[k]
        seen = parts.extract(
            recording.positions[start : start + (end - start) // 2], recording.rate_hz
        )
        assert foresight.weigh(expected).label == blocks.labels[k]
        # The order says another block: what is seen is believed.
        other = foresight.expect(blocks.labels[: k - 1])
        outlook = foresight.weigh(other, seen)
        assert outlook.label == blocks.labels[k]
        assert outlook.now.sum() == pytest.approx(1)
        assert outlook.following.sum() == pytest.approx(1)


def test_rests_are_habits_beside_the_order():
    blocks = BLOCKS[0]
    rested = dataclasses.replace(
        blocks, labels=tuple(IDLE if k % 2 else label for k, label in enumerate(blocks.labels))
    )
    foresight = Foresight(RECORDINGS[:1], [rested], RECIPE)
    assert foresight.labels[-1] == IDLE
    after_movement, following = foresight.expect([rested.labels[0]])
    after_rest, _ = foresight.expect(rested.labels[:2])
    # As by half a sighting, whatever their number.
    assert after_movement[-1] == pytest.approx(1.0 / 1.5)
    assert after_rest[-1] == pytest.approx(0.5 / 1.5)
    np.testing.assert_allclose(following[-1] * 1.0 / 1.5, after_rest[:-1])


def test_who_has_not_rested_yet_is_expected_to_go_on():
    blocks = BLOCKS[0]
    rested = dataclasses.replace(
        blocks, labels=tuple(IDLE if k % 2 else label for k, label in enumerate(blocks.labels))
    )
    foresight = Foresight(RECORDINGS[:1], [rested], RECIPE)
    first, second = rested.labels[0], rested.labels[2]
    # Others always rest, half a sighting; this person had one chance, and another, and took none.
    for before, chances in (([first, second], 1), ([first, second, first], 2)):
        rest = foresight.expect(before)[0][-1]
        others = 0.5 if before[-1] in rested.labels[:-1] else 0.0
        assert rest == pytest.approx((others + 0.5) / (0.5 + 1 + chances))
    # One who rests as others do is expected to.
    assert foresight.expect([first, IDLE, second])[0][-1] == pytest.approx(2.0 / 2.5)


def test_rests_one_after_the_other_are_one_habit(foresight):
    first = BLOCKS[0].labels[0]
    usual, _ = foresight.expect([first, IDLE])
    for before in ([first, *[IDLE] * 4], [first, *[IDLE] * 4, first]):
        now, following = foresight.expect(before)
        assert (now > 0.0).all()
        assert now.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(following.sum(axis=1), 1.0)
        if before[-1] == IDLE:
            np.testing.assert_array_equal(now, usual)


def test_the_next_start_is_the_median_of_times_that_are_long_enough():
    rng = np.random.default_rng(3)
    gaps = np.exp(rng.normal(np.log(1.2), 0.3, 400))
    starts = np.round(np.concatenate([[0], np.cumsum(gaps)]) * 1000).astype(int)
    bounds = np.stack([starts[:-1], starts[1:]], axis=1)
    long = LabelledSegments(bounds, ("up",) * 400, np.zeros(400), 1000.0, "long.tsv")
    # Nothing is seen, so that times alone are learnt.
    unseen = LabelledRecording(
        np.arange(starts[-1]) / 1000,
        np.full((starts[-1], 6, 3), np.nan),
        RECORDINGS[0].markers,
        np.zeros((starts[-1], 6), dtype=bool),
        1000.0,
        "long.tsv",
    )
    foresight = Foresight([unseen], [long], RECIPE)
    for elapsed in (0.0, 1.0, 1.8):
        left = gaps[gaps > elapsed] - elapsed
        assert foresight.seconds_to_next("up", elapsed) == pytest.approx(np.median(left), rel=0.15)
    assert foresight.seconds_to_next("up", 60.0) >= 0.0
    assert np.isnan(foresight.seconds_to_next("down", 0.0))
    slow = foresight.pace(("up",) * 4, (0.0, 2.4, 4.8, 7.2))
    assert slow == pytest.approx(np.log(2.0) * 3 / 4, abs=0.05)
    assert foresight.seconds_to_next("up", 0.0, slow) > 1.5 * foresight.seconds_to_next("up", 0.0)


def test_a_forecast_is_renewed_by_a_block_and_ten_times_a_second(foresight):
    recording, blocks, _ = step_recording(["step_up"], 5, "new.tsv")
    rate_hz = recording.rate_hz
    foreseer = BlockForeseer("right", foresight, recording.markers, rate_hz, "new.tsv")
    assert foreseer.update([], 1, recording.positions[:1])
    told = foreseer.forecast
    assert (told.label, told.start, told.next_label) == ("left", 0, "up")
    assert not foreseer.update([], 2, recording.positions[:2])
    assert foreseer.forecast is told
    first = (*blocks.bounds[0].tolist(), blocks.labels[0])
    now = first[1] + 1
    assert foreseer.update([first], now, recording.positions[first[1] : now], first[1])
    assert (foreseer.forecast.start, foreseer.forecast.label) == (first[1], "up")


def test_a_line_says_what_goes_on_and_what_follows():
    told = BlockForecast("right", 100, 90, "up", 0.91, "down", 0.8, 150)
    line = describe_forecast(told, 50.0)
    said = "2.00 s next block right up (91%) goes on, then down (80%) at 3.00 s"
    assert " ".join(line.split()) == said
    assert " at " not in describe_forecast(dataclasses.replace(told, next_row=None), 50.0)


def test_a_stream_is_foreseen_before_its_blocks_end(foresight):
    recording, blocks, _ = step_recording(["step_up", "step_down"] * 3, 7, "new.tsv")
    model = RecognizeConfig(unknown_factor=None).train(tuple(RECORDINGS), tuple(BLOCKS))
    arm = FollowedArm("right", ("hand_top",), model, None, foresight)
    segment = VmciOnlineConfig(
        rate_hz=20.0, border_probability=0.05, longest_s=3.0, calibration_s=1.0
    )
    follower = Follower(recording.markers, recording.rate_hz, [arm], segment=segment, steady_s=0.0)
    right = []
    for row, sample in enumerate(recording.positions):
        follower.push(sample)
        follower.look_ahead()
        for told in follower.state.forecasts:
            assert told.start <= row
            # Where the last border is a true one, what goes on is known.
            begun = np.flatnonzero(np.abs(blocks.bounds[:, 0] - told.start) <= 3)
            if len(begun) and told.row == row + 1 and row < blocks.bounds[begun[0], 1] - 5:
                right.append(told.label == blocks.labels[begun[0]])
    assert len(right) > 5
    assert np.mean(right) > 0.9
    follower.finish()
    assert follower.look_ahead() == ()
    assert set(ACTIONS["step_up"]) <= set(foresight.labels)


def test_blocks_without_their_recording_are_refused():
    with pytest.raises(RecognitionError, match=r"blocks of 'person_1\.tsv' have no recording"):
        Foresight(RECORDINGS[:1], BLOCKS, RECIPE)


def test_blocks_that_do_not_move_teach_no_order():
    still = dataclasses.replace(BLOCKS[0], labels=(IDLE,) * len(BLOCKS[0].labels))
    with pytest.raises(RecognitionError, match="got 0 labels"):
        Foresight(RECORDINGS[:1], [still], RECIPE)
