"""Blocks and actions of a stream, against those of the whole recording at once."""

import dataclasses
import itertools

import numpy as np
import pytest
from places import SAMPLE

from besman.exceptions import LabellingError, RecognitionError, RecordingError, SegmentationError
from besman.following.arms import FollowedArm
from besman.following.follower import Follower
from besman.following.plans import FollowPlan, label_stream, make_follower
from besman.io.recordings.formats import read_recording
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.compose.actions import compose_levels, train_level
from besman.stages.compose.borders import candidate_borders, measure_brisk, merge_borders
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.label.named_recording import NamedRecording
from besman.stages.label.stage import LabelConfig, LabelTrajectoriesConfig
from besman.stages.recognize.model import name_segments
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.sampling import sample_paths
from besman.stages.segment.signals import measure_scaling
from besman.stages.segment.stage import SegmentConfig, VmciOnlineConfig
from besman.synthetic.datasets import captures

RATE_HZ, METHOD_HZ, BORDER = 60.0, 20.0, 0.05
BACK = ("back_top", "back_left", "back_right")
RIGHT = ("hand_top", "elbow", "shoulder")
LEFT = tuple(f"left_{name}" for name in RIGHT)
WAYS = {
    "up": (0.0, 0.0, 0.15),
    "down": (0.0, 0.0, -0.15),
    "left": (0.0, 0.15, 0.0),
    "right": (0.0, -0.15, 0.0),
}
ACTIONS = {"step_up": ("left", "up", "left", "up"), "step_down": ("down", "right") * 2}
SEGMENT = VmciOnlineConfig(rate_hz=METHOD_HZ, border_probability=BORDER, longest_s=3.0)


def walk_arm(actions, side, rng):
    """Minimum-jerk blocks of one arm: positions of three markers, and its blocks."""
    pieces, bounds, labels, row = [], [], [], 0
    where = np.array([0.4, -0.2 * side, 1.0])
    for action in actions:
        for way in ACTIONS[action]:
            n = int(RATE_HZ * rng.uniform(0.5, 0.8))
            s = np.arange(n) / n
            step = WAYS[way] + rng.normal(scale=0.01, size=3)
            pieces.append(where + step * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis])
            where = where + step
            bounds.append((row, row + n))
            labels.append(way)
            row += n
    hand = np.concatenate(pieces)
    shoulder = np.broadcast_to([0.0, -0.2 * side, 1.4], hand.shape)
    return np.stack([hand, 0.5 * (hand + shoulder), shoulder], axis=1), np.array(bounds), labels


def person(actions, seed, source="stream"):
    """A recording of both arms, the blocks of each, and the right arm's actions."""
    rng = np.random.default_rng(seed)
    right, bounds, labels = walk_arm(actions, 1.0, rng)
    left, left_bounds, left_labels = walk_arm(actions, -1.0, rng)
    n = min(len(right), len(left))
    still = [[-0.1, 0.0, 1.4], [-0.1, 0.1, 1.3], [-0.1, -0.1, 1.3]]
    positions = np.concatenate(
        [np.broadcast_to(still, (n, 3, 3)), right[:n], left[:n]], axis=1
    ) + rng.normal(scale=3e-4, size=(n, 9, 3))
    recording = LabelledRecording(
        np.arange(n) / RATE_HZ,
        positions,
        (*BACK, *RIGHT, *LEFT),
        np.zeros((n, 9), dtype=bool),
        RATE_HZ,
        source,
    )

    def blocks(rows, names):
        whole = rows[:, 1] <= n
        kept = tuple(name for name, inside in zip(names, whole, strict=True) if inside)
        return LabelledSegments(rows[whole], kept, np.zeros(len(kept)), RATE_HZ, source)

    spans = [(bounds[4 * k, 0], min(bounds[4 * k + 3, 1], n)) for k in range(len(actions))]
    return recording, blocks(bounds, labels), blocks(left_bounds, left_labels), spans


@pytest.fixture(scope="module")
def lesson():
    """Arms and levels, learnt from another recording."""
    actions = ["step_up", "step_down"] * 2
    recording, right, left, spans = person(actions, 5, "lesson.tsv")
    models = [
        RecognizeConfig(markers=markers, idle_s=9.0).train((recording,), (blocks,))
        for markers, blocks in ((RIGHT, right), (LEFT, left))
    ]
    both = [(spans[0][0], spans[1][1]), (spans[2][0], spans[3][1])]
    levels = [
        train_level([recording], [spans], [actions], (*RIGHT, *LEFT)),
        train_level([recording], [both], [["round", "round"]], RIGHT),
    ]
    return models, levels


@pytest.fixture(scope="module")
def walk():
    return person(["step_up", "step_down"] * 3, 1)[0]


def scaling_of(recording, hand):
    return measure_scaling(sample_paths(recording, (hand,), METHOD_HZ)[0])


def make_arms(recording, models, names=("right", "left")):
    hands = {"right": "hand_top", "left": "left_hand_top"}
    return [
        FollowedArm(name, (hands[name],), model, scaling_of(recording, hands[name]))
        for name, model in zip(names, models, strict=False)
    ]


def follow(follower, positions, chunk=1):
    changes = []
    for first in range(0, len(positions), chunk):
        changes += follower.push(positions[first : first + chunk])
    return [*changes, *follower.finish()]


def offline_blocks(recording, hand, model):
    stage = SegmentConfig(
        rate_hz=METHOD_HZ, markers=(hand,), longest_s=3.0, border_probability=BORDER
    )
    (found,) = stage.run((recording,))
    return found.bounds, *name_segments(model, recording, found.bounds)


def check_pieces(pieces, bounds, labels, uncertainty):
    assert [(one.start, one.end) for one in pieces] == [tuple(rows) for rows in bounds]
    assert tuple(one.label for one in pieces) == tuple(labels)
    np.testing.assert_allclose([one.uncertainty for one in pieces], uncertainty, atol=1e-9)
    assert all(one.final for one in pieces)


@pytest.mark.parametrize(("n_arms", "chunk"), [(1, 1), (2, 1), (2, 17)])
def test_after_the_end_all_is_as_for_the_whole_recording(lesson, walk, n_arms, chunk):
    models, levels = lesson
    follower = Follower(
        walk.markers, RATE_HZ, make_arms(walk, models[:n_arms]), levels, SEGMENT,
        horizon_blocks=None,
    )  # fmt: skip
    follow(follower, walk.positions, chunk)
    state = follower.state
    found = [
        offline_blocks(walk, hand, model)
        for hand, model in zip(("hand_top", "left_hand_top"), models, strict=True)
    ][:n_arms]
    for pieces, expected in zip(state.blocks.values(), found, strict=True):
        check_pieces(pieces, *expected)
    borders = merge_borders([bounds for bounds, _, _ in found])
    whole = compose_levels(walk, borders, levels)
    for pieces, level in zip(state.actions, whole, strict=True):
        check_pieces(
            pieces, itertools.pairwise(level.borders), level.labels, level.uncertainties
        )  # fmt: skip
    assert state.fitness == pytest.approx([level.fitness for level in whole], abs=1e-9)


@pytest.mark.parametrize("chunk", [1, 23])
def test_with_places_where_hands_are_slow_all_is_as_for_the_whole_recording(lesson, walk, chunk):
    models, levels = lesson
    hands = ("hand_top", "left_hand_top")
    brisk = {hand: measure_brisk([walk], hand) for hand in hands}
    follower = Follower(
        walk.markers, RATE_HZ, make_arms(walk, models), levels, SEGMENT, brisk_m_s=brisk,
        longest_blocks=24, horizon_blocks=None,
    )  # fmt: skip
    follow(follower, walk.positions, chunk)
    blocks = [
        offline_blocks(walk, hand, model)[0] for hand, model in zip(hands, models, strict=True)
    ]
    borders = candidate_borders(walk, blocks, hands)
    assert borders.tolist() != merge_borders(blocks).tolist()
    whole = compose_levels(walk, borders, levels, 24)
    for pieces, level in zip(follower.state.actions, whole, strict=True):
        check_pieces(
            pieces, itertools.pairwise(level.borders), level.labels, level.uncertainties
        )  # fmt: skip


@pytest.mark.parametrize("hands", [(), ("hand_top",)])
def test_changes_add_up_to_the_state_and_what_is_final_stays(lesson, walk, hands):
    models, levels = lesson
    follower = Follower(
        walk.markers, RATE_HZ, make_arms(walk, models), levels, SEGMENT, longest_blocks=12,
        horizon_blocks=6, brisk_m_s={hand: measure_brisk([walk], hand) for hand in hands},
    )  # fmt: skip
    held, final, early = {}, {}, 0

    def key_of(piece):
        return piece.kind, piece.of, piece.start, piece.end

    for row in range(len(walk.time) + 1):
        last = row == len(walk.time)
        for change in follower.finish() if last else follower.push(walk.positions[row]):
            one, was = change.piece, change.before
            if was is not None:
                assert held.pop(key_of(was)) == was
            assert key_of(one) not in final
            assert (was is None) == (change.status == "new") or change.status == "final"
            if change.status == "final":
                final[key_of(one)] = one
                early += not last
            elif change.status != "gone":
                held[key_of(one)] = one
        state = follower.state
        pieces = [*state.blocks["right"], *state.blocks["left"], *sum(state.actions, ())]
        assert {key_of(piece): piece for piece in pieces} == held | final
        for group in (*state.blocks.values(), *state.actions):
            assert all(one.end == two.start for one, two in itertools.pairwise(group))
    assert not held
    assert early > 10
    assert {one.label for one in state.actions[0]} <= set(ACTIONS)


def test_blocks_are_known_before_they_are_final(lesson, walk):
    follower = Follower(walk.markers, RATE_HZ, make_arms(walk, lesson[0][:1]), (), SEGMENT)
    first_known = {}
    for row, sample in enumerate(walk.positions):
        for change in follower.push(sample):
            first_known.setdefault((change.piece.start, change.piece.end), row)
    follower.finish()
    delays = [
        first_known[one.start, one.end] - one.end
        for one in follower.state.blocks["right"][:-1]
        if (one.start, one.end) in first_known
    ]
    assert len(delays) > 12
    assert np.median(delays) < 1.5 * RATE_HZ


def test_memory_is_bounded_with_a_horizon(lesson, walk):
    models, levels = lesson
    follower = Follower(
        walk.markers, RATE_HZ, make_arms(walk, models), levels[:1], SEGMENT,
        longest_blocks=8, horizon_blocks=6,
    )  # fmt: skip
    sizes = []
    for _ in range(3):
        # The same walk again and again: the hands jump back, which is a border.
        for sample in walk.positions:
            follower.push(sample)
        sizes.append(len(follower._frames._values))
    assert sizes[-1] == sizes[1]


def test_short_gaps_are_held(lesson, walk):
    models, levels = lesson
    gappy, held = walk.positions.copy(), walk.positions.copy()
    for column, start, end in ((3, 100, 112), (4, 300, 315), (0, 0, 4)):
        gappy[start:end, column] = np.nan
        held[start:end, column] = held[start - 1 if start else end, column]
    states = []
    for positions in (gappy, held):
        follower = Follower(walk.markers, RATE_HZ, make_arms(walk, models), levels, SEGMENT)
        follow(follower, positions, 10)
        states.append(follower.state)
    assert states[0] == states[1]
    assert all(np.isfinite(one.uncertainty) for one in states[0].blocks["right"])


def test_what_a_long_gap_touches_is_unknown_and_the_stream_goes_on(lesson, walk):
    models, levels = lesson
    positions = walk.positions.copy()
    gap = (300, 340)
    positions[slice(*gap), walk.markers.index("elbow")] = np.nan
    follower = Follower(walk.markers, RATE_HZ, make_arms(walk, models), levels, SEGMENT)
    follow(follower, positions, 10)
    lost = (gap[0] + round(0.25 * RATE_HZ), gap[1])
    state = follower.state
    for one in (*state.blocks["right"], *state.actions[0]):
        touched = one.start < lost[1] and one.end > lost[0]
        assert np.isinf(one.uncertainty) == touched
        assert one.label == "unknown" or not touched
    assert all(np.isfinite(one.uncertainty) for one in state.blocks["left"])


def test_scaling_measured_on_the_stream(lesson, walk):
    (arm,) = make_arms(walk, lesson[0][:1])
    measured = dataclasses.replace(arm, scaling=None)
    whole = SEGMENT.model_copy(update={"calibration_s": 100.0})
    states = []
    for one, segment in ((arm, SEGMENT), (measured, whole)):
        follower = Follower(walk.markers, RATE_HZ, [one], (), segment)
        follow(follower, walk.positions)
        states.append(follower.state)
    assert states[0] == states[1]
    early = Follower(walk.markers, RATE_HZ, [measured], (), SEGMENT)
    rows = [row for row, sample in enumerate(walk.positions) if early.push(sample)]
    assert rows[0] == round(10 * RATE_HZ) - 1


def test_each_model_is_an_arm(lesson, walk):
    models, levels = lesson
    earlier = person(["step_up"] * 2, 7)[0]
    plan = FollowPlan(
        ((models[0], ("hand_top",)), (models[1], ())), segment=SEGMENT, levels=levels,
        slow_hands=("hand_top",), longest_blocks=12, earlier=(earlier,),
    )  # fmt: skip
    follower = make_follower(plan, walk, 20, 0.2)
    follow(follower, walk.positions, 10)
    assert list(follower.state.blocks) == ["right", "left"]
    assert len(follower.state.blocks["left"]) > 10
    joint = dataclasses.replace(plan, models=((models[0], ("hand_top", "left_hand_top")),))
    assert list(make_follower(joint, walk, 20, 0.2).state.blocks) == ["right+left"]


def test_a_sensor_suit_is_followed_with_its_orientations():
    capture = next(captures("gestures", 1, 1))
    recording = label_stream(FollowPlan((), LabelConfig(markers="xsens")), capture.recording)
    model = RecognizeConfig().train((recording,), (capture.segments,))
    assert "hand_orientation" in model.recipe.features
    hand = model.recipe.markers[0]
    arm = FollowedArm("right", (hand,), model, scaling_of(recording, hand))
    follower = Follower(
        recording.markers, recording.rate_hz, [arm], (), SEGMENT, oriented=True
    )  # fmt: skip
    samples = np.concatenate([recording.positions, recording.orientations], axis=2)
    with pytest.raises(RecordingError, match=r"got shape \(\d+, 3\); expected \(\d+, 7\)"):
        follower.push(recording.positions[0])
    follow(follower, samples, 10)
    check_pieces(follower.state.blocks["right"], *offline_blocks(recording, hand, model))


@pytest.mark.parametrize("label", [DefaultLabelConfig(), LabelTrajectoriesConfig()])
def test_names_of_a_stream_are_taken_or_found(label):
    whole = read_recording(SAMPLE / "subject2.tsv")
    positions = whole.positions[:600].copy()
    positions[200:203, whole.names.index("Elbow")] = np.nan
    named = dataclasses.replace(whole, time=whole.time[:600], positions=positions)
    bare = dataclasses.replace(named, names=(None,) * len(named.names))
    plan = FollowPlan((), label, str(SAMPLE / "subject1.tsv"))
    own, found = (label_stream(plan, recording) for recording in (named, bare))
    assert own.markers == found.markers
    # With names of its own the stream keeps its gaps.
    taken = label.looks_at_names
    assert np.isnan(own.marker("elbow")).any() == taken
    assert isinstance(own, NamedRecording) != taken
    assert isinstance(found, NamedRecording)
    assert not np.isnan(found.marker("elbow")).any()


def test_bad_streams(lesson, walk):
    models, levels = lesson
    arms = make_arms(walk, models)

    def start(**changes):
        wanted = {"markers": walk.markers, "arms": arms, "levels": levels, **changes}
        return Follower(rate_hz=RATE_HZ, segment=SEGMENT, **wanted)

    with pytest.raises(RecognitionError, match="stream: got arms none; expected one or more"):
        start(arms=[])
    with pytest.raises(RecognitionError, match="got arms right, right; expected one or more, each"):
        start(arms=[arms[0], arms[0]])
    with pytest.raises(RecognitionError, match=r"no marker 'left_hand_top'; did you mean"):
        start(markers=walk.markers[:6])
    with pytest.raises(RecognitionError, match="no marker 'left_hand_top'"):
        start(markers=walk.markers[:6], arms=arms[:1])
    with pytest.raises(RecognitionError, match="no marker 'back_top': the person's frame needs"):
        start(markers=("b", *walk.markers[1:]))
    with pytest.raises(RecognitionError, match="no marker 'elbow'; did you mean 'left_elbow'"):
        start(markers=("back_top", "back_left", "back_right", "hand_top", "e", *walk.markers[5:]))
    with pytest.raises(RecordingError, match="got 0 Hz, gaps up to"):
        Follower(walk.markers, 0.0, arms)
    follower = start()
    with pytest.raises(RecordingError, match=r"sample 0: got shape \(8, 3\); expected \(9, 3\)"):
        follower.push(walk.positions[0, :8])
    bad = walk.positions[:3].copy()
    bad[2, 4] = np.inf
    with pytest.raises(RecordingError, match="sample 2: marker 'elbow' is at infinity"):
        follower.push(bad)
    with pytest.raises(LabellingError, match="ended after 0 samples: no sample"):
        follower.finish()
    unseen = walk.positions.copy()
    unseen[:20, 4] = np.nan
    with pytest.raises(LabellingError, match="'elbow' is not seen in the first 16 samples"):
        follow(start(), unseen)
    with pytest.raises(LabellingError, match="ended after 5 samples: marker 'elbow' unseen"):
        follow(start(), unseen[:5])
    with pytest.raises(SegmentationError, match="needs at least 2 samples at 20 Hz, got 1"):
        follow(start(), walk.positions[:3])
    done = start()
    follow(done, walk.positions[:60])
    with pytest.raises(RecordingError, match="finished after 60 samples; start a new one"):
        done.push(walk.positions[60])


def test_nothing_to_measure_the_scaling_on(lesson, walk):
    arm = FollowedArm("right", ("hand_top",), lesson[0][0])
    still = np.broadcast_to(walk.positions[:1], walk.positions.shape)
    with pytest.raises(SegmentationError, match="hand_top did not move in the first 10 s"):
        follow(Follower(walk.markers, RATE_HZ, [arm], (), SEGMENT), still)
    with pytest.raises(SegmentationError, match="which is 1 sample at 20 Hz"):
        follow(Follower(walk.markers, RATE_HZ, [arm], (), SEGMENT), still[:3])
