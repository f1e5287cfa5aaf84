"""What the page and the report are given of whole tasks (synthetic)."""

import dataclasses
import functools
import itertools

import numpy as np
from whole_task import carry_box

from besman.records.task_trial import RefinedTask
from besman.report.task_table import task_table
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.refine.whole_tasks import AimTasks, SimulateTasks
from besman.view.packing import Packer
from besman.view.person import PersonMarkers
from besman.view.whole_tasks import WholeTasks, block_spans, person_spans

TASK = load_whole_task("rearrange")


@functools.cache
def records():
    robot, demonstration, plan = carry_box()
    aimed = AimTasks(CmaEsConfig()).run((plan,), robot, TASK)
    trials = SimulateTasks(CmaEsConfig()).run(aimed, (plan,), robot, TASK)
    return {"blocks": (demonstration,), "task_plans": (plan,), "aim": aimed, "simulate": trials}


def test_a_take_has_its_blocks_and_the_person_does_the_same_in_each():
    robot, demonstration, plan = carry_box()
    (take,) = WholeTasks.of(records(), robot, TASK).takes(plan.name, 25.0)
    assert (take.title, take.success) == ("imitated", True)
    labels = {block["label"] for block in take.blocks}
    assert labels == {*(block.label for block in plan.blocks), "takes it", "lets go"}
    own, person = np.array(take.clock)
    assert np.all(np.diff(own) >= 0)
    assert np.all(np.diff(person) >= 0)
    # The person's box leaves its place when the robot begins to carry its own.
    carried = next(one["start"] for one in take.blocks if one["label"] == "move_obj_table")
    assert abs(np.interp(carried, own, person) - demonstration.holds_s[0, 0]) < 0.3
    assert take.start_s + take.interval_s * (len(take.joints) - 1) >= own[-1]
    kinds = {(shape["role"], shape["kind"]) for shape in take.shapes}
    assert {("object", "box"), ("fixed", "box")} <= kinds


def test_a_box_that_falls_stays_at_the_floor():
    robot, _, plan = carry_box()
    (aimed,), (trial,) = records()["aim"], records()["simulate"]
    close_s, open_s = aimed.events_s
    early = dataclasses.replace(aimed, events_s=np.array([close_s, (close_s + open_s) / 2]))
    refined = RefinedTask(early, trial, 2)
    whole = WholeTasks.of(records() | {"refine_tasks": (refined,)}, robot, TASK)
    take = whole.takes(plan.name, 25.0)[-1]
    assert np.all(take.bodies[-1, :, 2] > -0.2)
    assert take.object_path[:, 2].min() > -0.2
    assert np.linalg.norm(take.object_path[-1] - trial.wanted[0, :3]) > 0.2


def test_blocks_last_as_long_as_the_arm_needs_and_wait_for_the_gripper():
    (aimed,) = records()["aim"]
    spans, way = block_spans(aimed, TASK), TASK.way(aimed)
    lasting = [block.duration for block in aimed.blocks]
    np.testing.assert_allclose(spans[:, 1] - spans[:, 0], lasting)
    waits = spans[1:, 0] - spans[:-1, 1]
    np.testing.assert_allclose(spans[:-1, 1][waits > 1e-9], way.commands_s)
    wait = TASK.wait
    np.testing.assert_allclose(waits[waits > 1e-9], [wait.closing_s, wait.opening_s])
    # The last sample at 1 kHz is just past the end.
    assert 0 <= way.movements.ends[0] - spans[-1, 1] - wait.settle_s < 1e-3
    _, demonstration, plan = carry_box()
    whole = person_spans(plan, plan, demonstration)
    assert (whole[0, 0], whole[-1, 1]) == (0.0, demonstration.hand.time[-1])


def test_the_box_is_where_the_person_has_it():
    robot, demonstration, _ = carry_box()
    whole = WholeTasks.of(records(), robot, TASK)
    n = 1 + int(demonstration.hand.time[-1] / 0.1)
    person = PersonMarkers(("a",), np.zeros((n, 1, 3)), 0.0, 0.1, 1.2, [], [], -1, True)
    kept = []

    class Kept(Packer):
        def add(self, values):
            kept.append(values)
            return super().add(values)

    (box,) = whole.boxes(demonstration.hand, person, Kept())
    assert box["size"] == [size / 2 for size in TASK.box.size_m]
    markers = demonstration.object_positions[0, 0] + (0.0, 0.0, 1.2)
    apart = np.linalg.norm(kept[0][0, :3] - markers)
    assert abs(apart - np.linalg.norm(whole.frame.centre_m)) < 1e-3


def test_what_became_of_a_task_is_what_its_last_trial_says():
    robot, _, plan = carry_box()
    found = records()
    whole = WholeTasks.of(found, robot, TASK)
    assert whole.outcome("nobody") is None
    assert whole.outcome(plan.name)["status"] == "success"
    refined = RefinedTask(found["aim"][0], found["simulate"][0], 3)
    whole = WholeTasks.of(found | {"refine_tasks": (refined,)}, robot, TASK)
    assert [take.title for take in whole.takes(plan.name, 5.0)] == ["imitated", "refined"]


def test_the_report_has_a_row_a_block_and_the_outcome_where_the_box_is_put():
    _, _, plan = carry_box()
    assert task_table({}) == ""
    table = task_table(records())
    labels = [label for label, _ in itertools.groupby(block.label for block in plan.blocks)]
    assert table.count("<tr>") - 1 == len(labels)
    assert all(f">{label}<" in table for label in labels)
    assert f">{1e3 * records()['simulate'][0].miss:.1f}<" in table
    assert table.count(">yes<") == 1
    assert "simulations" not in task_table({"task_plans": (plan,)})
