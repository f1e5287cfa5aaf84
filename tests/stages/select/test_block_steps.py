"""Whole actions of a synthetic person, whose blocks and box are known."""

import dataclasses

import numpy as np
import pytest
from pydantic import ValidationError
from whole_task import GRAMMAR, MARKERS, divide_actions, make_select, record_take

from besman.exceptions import MappingError
from besman.geometry.frames import quaternion_to_rotation
from besman.pipeline.config import PipelineConfig
from besman.records import BlockDemonstration, ShapeError
from besman.records.files import load_record, save_record
from besman.stages.select.block_steps import DivideActions, FindActions
from besman.stages.select.hand_motion import call_rests, hand_motion, refuse_both_hands
from besman.stages.select.handled_objects import track_object
from besman.stages.select.holds import find_holds
from besman.stages.select.stage import SelectConfig
from besman.work.work import Notes, Work


@pytest.fixture(scope="module")
def take():
    """Recording and true blocks of one person (synthetic)."""
    return record_take()


def test_an_action_has_its_blocks_its_box_and_its_grasp(take):
    recording, blocks = take
    for name, sequence in GRAMMAR.items():
        (found,) = divide_actions(recording, blocks, make_select(name))
        rows = [blocks.labels.index(label) for label in sequence]
        start = blocks.bounds[rows[0], 0]
        assert found.labels == sequence
        assert (found.name, found.hand.label) == (f"{recording.source}:{list(GRAMMAR).index(name)}",
                                                  name)  # fmt: skip
        true = (blocks.bounds[rows] - start) / recording.rate_hz
        np.testing.assert_allclose(found.bounds_s, true, atol=1.01 / recording.rate_hz)
        # The box moves during the second block, which it begins and ends.
        assert found.held == ("box",)
        np.testing.assert_allclose(found.holds_s[0], true[1], atol=0.1)
        assert [found.block_at(when) for when in found.holds_s[0] + (0.05, -0.05)] == [1, 1]
        assert np.nanmin(found.opening_m) > 0.0


def test_the_box_is_in_the_frame_of_the_hands_way(take):
    """What is near the hand in the laboratory is as near to it there."""
    recording, blocks = take
    (found,) = divide_actions(recording, blocks, make_select())
    start = blocks.bounds[blocks.labels.index("approach_forward"), 0]
    row = blocks.bounds[blocks.labels.index("move_obj_table"), 0] - start + 20
    k = int(np.argmin(np.abs(found.hand.time - row / recording.rate_hz)))
    centre, hand2lab = hand_motion(recording, (0, len(recording.time)), "right")
    box = np.mean([recording.marker(name) for name in MARKERS.objects["box"]], axis=0)
    inside = hand2lab[start + row].T @ (box - centre)[start + row]
    hand2back = quaternion_to_rotation(found.hand.poses[k, 3:])
    here = hand2back.T @ (found.object_positions[k, 0] - found.hand.poses[k, :3])
    # The hand's frame is turned to its fingers.
    assert np.linalg.norm(here) == pytest.approx(np.linalg.norm(inside), abs=0.01)
    # It is turned as the line between its markers is, whatever frame that is seen from.
    moved = found.object_headings[-1, 0] - found.object_headings[0, 0]
    along = recording.marker("box_left") - recording.marker("box_back")
    angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    stop = start + round(found.hand.time[-1] * recording.rate_hz)
    assert moved == pytest.approx(angle[stop] - angle[start], abs=0.02)


def test_it_is_stored_and_comes_back(take, tmp_path):
    (found,) = divide_actions(*take, make_select())
    save_record((found,), tmp_path / "a.npz")
    (again,) = load_record(tmp_path / "a.npz")
    for one in dataclasses.fields(BlockDemonstration):
        if isinstance(getattr(found, one.name), np.ndarray):
            np.testing.assert_array_equal(getattr(again, one.name), getattr(found, one.name))
    assert (again.labels, again.held, again.objects) == (found.labels, found.held, found.objects)
    with pytest.raises(ShapeError, match=r"BlockDemonstration.labels must have 3 entries, got 2"):
        dataclasses.replace(found, labels=found.labels[:2])
    with pytest.raises(ShapeError, match=r"opening_m must have shape \(\d+\), got \(3,\)"):
        dataclasses.replace(
            found, opening_m=np.zeros(3), object_positions=np.zeros((3, 1, 3)),
            object_headings=np.zeros((3, 1)),
        )  # fmt: skip


def test_a_rest_that_is_like_no_other_is_a_rest(take):
    recording, blocks = take
    strange = [
        "unknown" if label == "idle" else label for label in blocks.labels
    ]  # fmt: skip
    (found,) = divide_actions(
        recording, dataclasses.replace(blocks, labels=tuple(strange)), make_select()
    )
    assert found.labels == GRAMMAR["to_table"]
    # A movement that nobody knows is none.
    strange[blocks.labels.index("move_obj_table")] = "unknown"
    unknown = dataclasses.replace(blocks, labels=tuple(strange))
    with pytest.raises(MappingError, match="no block is labelled 'move_obj_table'"):
        divide_actions(recording, unknown, make_select())
    called = call_rests(recording, unknown, "right").labels
    assert called.count("unknown") == 1
    assert called.count("idle") == blocks.labels.count("idle")


def test_actions_may_be_named_by_hand(take):
    recording, blocks = take
    start, stop = blocks.bounds[1, 0], blocks.bounds[5, 1]
    manual = dataclasses.replace(
        blocks, bounds=np.array([[start, stop]]), labels=("tidy",), distances=np.zeros(1),
        layers=("actions",),
    )  # fmt: skip
    config = make_select("tidy", {})
    (actions,) = FindActions(config).run((take[0],), (blocks,), (manual,))
    assert actions.bounds.tolist() == [[start, stop]]
    hands = config.run((recording,), (actions,))
    (found,) = DivideActions(config).run((recording,), (blocks,), (actions,), hands, MARKERS)
    assert found.labels == GRAMMAR["to_table"]
    other = dataclasses.replace(blocks, source="b.tsv")
    assert FindActions(config).run((take[0],), (other,), (manual,))[0].labels == ()
    with pytest.raises(MappingError, match=r"select.action: got 'tiddy'; .*tidy"):
        FindActions(make_select("tiddy", {})).run((take[0],), (blocks,), (manual,))


def test_figures_say_what_was_found(take):
    recording, blocks = take
    config = make_select()
    actions = FindActions(config).run((take[0],), (blocks,), ())
    assert FindActions(config).figures(actions, None)["counts"] == {"to_shelf": 1, "to_table": 1}
    found = divide_actions(recording, blocks, config)
    (told,) = DivideActions(config).figures(found, None)["demonstrations"].values()
    assert told["blocks"] == list(GRAMMAR["to_table"])
    assert told["holds"][0]["grasp_in"] == told["holds"][0]["release_in"] == "move_obj_table"


def test_a_misspelt_block_and_an_order_that_nobody_shows_are_errors(take):
    _, blocks = take
    with pytest.raises(MappingError, match=r"to_table: no block is labelled 'aproach_forward'"):
        FindActions(make_select(actions={"to_table": ("aproach_forward",)})).run(
            (take[0],), (blocks,), ()
        )
    backwards = {"to_table": GRAMMAR["to_table"][::-1]}
    with pytest.raises(MappingError, match="follow each other in none of 1 recordings"):
        FindActions(make_select(actions=backwards)).run((take[0],), (blocks,), ())


def test_what_goes_wrong_in_one_action_is_said(take):
    recording, blocks = take
    held = {"to_table": ("approach_forward", "move_obj_table")}
    early = dataclasses.replace(
        blocks,
        bounds=np.where(
            np.arange(len(blocks.labels))[:, np.newaxis] == 3,
            blocks.bounds - [0, 20],
            blocks.bounds,
        ),
    )
    with pytest.raises(MappingError, match=r"box is grasped at .* and not released before"):
        divide_actions(recording, early, make_select(actions=held))
    positions = recording.positions.copy()
    positions[150:200, recording.markers.index("box_left")] = np.nan
    gone = dataclasses.replace(recording, positions=positions)
    with pytest.raises(MappingError, match=r"box: marker 'box_left' is not seen in frames .*leave"):
        divide_actions(gone, blocks, make_select())
    config = make_select("tidy", {})
    rest = blocks.take([0])
    (actions,) = FindActions(config).run((take[0],), (blocks,), (_tidy(blocks),))
    hands = config.run((recording,), (actions,))
    with pytest.raises(MappingError, match="no block lies within the action 'tidy'"):
        DivideActions(config).run((recording,), (rest,), (actions,), hands, MARKERS)
    with pytest.raises(MappingError, match="the left arm is not complete"):
        hand_motion(recording, (0, 5), "left")


def test_a_recording_that_ends_within_an_action_is_said_and_the_rest_goes_on(take):
    recording, blocks = take
    cut = blocks.labels.index("move_obj_table") + 1
    short = dataclasses.replace(blocks.take(np.arange(cut)), source="short.tsv")
    other = dataclasses.replace(recording, source="short.tsv")
    work = Work(notes=Notes())
    both = FindActions(make_select()).run((recording, other), (blocks, short), (), work)
    assert [len(found.labels) for found in both] == [2, 0]
    (told,) = work.notes.failures
    assert str(told).startswith("short.tsv: to_table: begins at ")
    assert str(told).endswith("s, and the recording ends before move_to_rest_right")


def test_a_box_in_both_hands_is_refused(take):
    recording, _ = take
    names = [name for name in recording.markers if name.startswith(("hand", "elbow", "should"))]
    columns = [recording.markers.index(name) for name in names]
    two = dataclasses.replace(
        recording,
        markers=(*recording.markers, *(f"left_{name}" for name in names)),
        positions=np.concatenate([recording.positions, recording.positions[:, columns]], axis=1),
        filled=np.concatenate([recording.filled, recording.filled[:, columns]], axis=1),
    )
    rows = (0, len(recording.time))
    track = track_object(recording, rows, "box", MARKERS.objects["box"], 0.5, "take")
    way, turned = hand_motion(recording, rows, "right")
    held, *_ = find_holds(way, track.positions, recording.rate_hz, turned)
    with pytest.raises(MappingError, match=r"take: box is held by both hands at \d+\.\d\d s"):
        refuse_both_hands(two, rows, held, ("box", track), "right", "take")
    refuse_both_hands(recording, rows, held, ("box", track), "right", "take")
    before = (0, int(held[0]))
    refuse_both_hands(two, rows, before, ("box", track), "right", "take")


def _tidy(blocks):
    return dataclasses.replace(
        blocks, bounds=blocks.bounds[:3].reshape(-1)[[0, -1]].reshape(1, 2), labels=("tidy",),
        distances=np.zeros(1), layers=("actions",),
    )  # fmt: skip


def test_blocks_are_of_actions():
    with pytest.raises(ValidationError, match="expected action: NAME in place of label"):
        SelectConfig(**{"label": "throw", "as": "blocks"})
    with pytest.raises(ValidationError, match="as"):
        SelectConfig(**{"action": "tidy", "as": "block"})
    assert SelectConfig(action="tidy").model_dump(mode="json")["as"] == "movement"
    assert "as" in PipelineConfig.model_json_schema()["$defs"]["SelectConfig"]["properties"]


def test_several_actions_are_selected_as_if_each_were_alone(take):
    recording, blocks = take
    both = divide_actions(recording, blocks, make_select(("to_table", "to_shelf")))
    alone = [divide_actions(recording, blocks, make_select(name))[0] for name in GRAMMAR]
    assert [one.hand.label for one in both] == ["to_table", "to_shelf"]
    for one, other in zip(both, alone, strict=True):
        assert (one.name, one.labels) == (other.name, other.labels)
        np.testing.assert_array_equal(one.bounds_s, other.bounds_s)
        np.testing.assert_array_equal(one.hand.poses, other.hand.poses)
    lone = {**GRAMMAR, "back": ("move_obj_shelf", "approach_forward")}
    with pytest.raises(
        MappingError, match=r"select\.actions\.back: move_obj_shelf, approach_forwa"
    ):
        divide_actions(recording, blocks, make_select(("to_table", "back"), lone))


def test_several_actions_are_of_the_recipe_and_as_blocks():
    with pytest.raises(
        ValidationError, match=r"got 'to_tabel', one of several; did you mean 'to_t"
    ):
        make_select(("to_shelf", "to_tabel"))
    with pytest.raises(ValidationError, match="several make no one movement; expected as: blocks"):
        make_select(("to_shelf", "to_table"), **{"as": "movement"})
    with pytest.raises(ValidationError, match="at least 1 item"):
        make_select(())
