"""What blocks do is learnt from where they were shown (synthetic)."""

from dataclasses import replace

import numpy as np
import pytest
from whole_task import learn_both

from besman.exceptions import PlanError
from besman.planning.block_effects import (
    BlockUse,
    find_uses,
    learn_blocks,
    same_effect,
    shown_ends,
    shown_successions,
    standing_poses,
)
from besman.planning.places import describe_places, find_places, name_places


def use(task, label, frame="world", thing="", before="away"):
    return BlockUse(task, 0, label, frame, thing, before)


def test_effects_of_the_embedded_kind_of_task_are_those_that_its_names_say():
    learnt = learn_both()
    names = [place.name for place in learnt.places]
    assert names == ["shelf", "table"]
    found = {
        block.label: (block.frame, names[block.place] if block.place >= 0 else "", block.before)
        for block in learnt.blocks
    }
    assert found == {
        "approach_forward": ("object", "shelf", {"away"}),
        "move_obj_table": ("target", "table", {"full"}),
        "move_to_rest_right": ("world", "", {"at"}),
        "approach_right": ("object", "table", {"away"}),
        "move_obj_shelf": ("target", "shelf", {"full"}),
        "move_to_rest_down": ("world", "", {"at"}),
    }
    assert (learnt.first, learnt.ends, learnt.kinds) == (("box", 0), {"away"}, ("box",))
    assert ("move_obj_table", "move_to_rest_right") in learnt.shown
    assert ("move_obj_table", "move_to_rest_down") not in learnt.shown
    down = next(block for block in learnt.blocks if block.label == "move_to_rest_down")
    assert [one.label for one in same_effect(down, learnt.blocks)] == ["move_to_rest_right"]
    low, high = (place.pose[2] for place in reversed(learnt.places))
    assert high - low > 0.1


def test_a_task_that_does_not_fit_together_teaches_nothing():
    plan = learn_both().bench.plans[0]
    named = [block for block in plan.blocks if block.label != "idle"]
    assert [one.before for one in find_uses([plan])] == ["away", "full", "at"]
    still = np.zeros_like(named[1].start)
    carry = replace(named[1], start_velocity=still)
    rest = replace(named[2], start=carry.goal, start_velocity=carry.goal_velocity)
    assert find_uses([replace(plan, blocks=(carry, rest))]) == ()
    poses = standing_poses(find_uses([plan]), [plan])
    np.testing.assert_array_equal(poses[0], plan.object_poses[0])
    np.testing.assert_array_equal(poses[1], plan.target_poses[0])
    assert np.isnan(poses[2]).all()


def test_the_most_frequent_effect_counts_and_places_are_kept_apart():
    uses = (
        use(0, "go", "object", "box"), use(0, "put", "target", "box", "full"),
        use(1, "go", "object", "box"), use(1, "put", "target", "box", "full"),
        use(2, "go"), use(2, "away", before="at"),
    )  # fmt: skip
    go, low, high, away = learn_blocks(uses, (0, 1, 0, 2, -1, -1))
    assert (go.frame, len(go.uses), go.place) == ("object", 2, 0)
    assert (low.place, high.place, away.frame) == (1, 2, "world")
    assert shown_successions(uses) == {("go", "put"), ("go", "away")}
    assert shown_ends(uses) == {"at", "away"}
    with pytest.raises(PlanError, match=r"no block puts an object down; learnt: go"):
        learn_blocks(uses[:1], (0,))
    with pytest.raises(PlanError, match=r"no block takes an object; learnt: nothing"):
        learn_blocks((), ())


def test_places_are_where_objects_would_stand_in_one_another_or_one_block_leads():
    uses = [use(k, label, "target", "box") for k, label in enumerate("aabab")]
    positions = np.array([[0, 0, 1.0], [0.5, 0, 1.05], [0.6, 0, 1.0], [0, 0, 0.5], [np.nan] * 3])
    size_m = (0.08, 0.1, 0.18)
    assert find_places(uses, positions, size_m).tolist() == [0, 0, 0, 1, -1]
    assert find_places(uses[:1], positions[:1], size_m).tolist() == [0]
    assert find_places([], np.empty((0, 3)), size_m).tolist() == []


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        ((["move_obj_table"], ["move_obj_shelf"]), ("table", "shelf")),
        ((["put"], ["put"]), ("put_1", "put_2")),
        ((["move_table"], ["move_table"], ["move_shelf"]), ("table_1", "table_2", "shelf")),
        ((["put_on_table", "slide_on_table"], ["put_on_shelf"]), ("table", "shelf")),
        ((["put"],), ("put",)),
    ],
)
def test_places_are_named_by_what_distinguishes_their_blocks(labels, names):
    assert name_places(labels) == names


@pytest.mark.parametrize("noise", [1e-12, -1e-12])
def test_of_two_that_are_as_far_from_their_middle_the_first_is_the_place(noise):
    uses = [use(0, "put_table", "target", "box"), use(1, "put_table", "target", "box")]
    poses = np.array([[0.1, 0.2, 1.0, 1, 0, 0, 0], [0.2 + noise, 0.2, 1.0, 1, 0, 0, 0]])
    (place,) = describe_places(uses, poses, np.zeros(2, dtype=np.int64))
    np.testing.assert_array_equal(place.pose, poses[0])
