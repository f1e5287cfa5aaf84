"""A take of a plan: its markers obey the plan, its truth the script."""

import numpy as np
import pytest

from besman.synthetic.body import RIGHT
from besman.synthetic.person import draw_person
from besman.synthetic.reaching import plan_pick_and_place
from besman.synthetic.script import draw_temper
from besman.synthetic.stance import draw_stance, stream
from besman.synthetic.take import Action, Plan, Setting, play_plan
from besman.synthetic.true_borders import time_phases

RATE_HZ = 100.0


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(0)
    person, temper = draw_person(rng), draw_temper(rng)
    plan = plan_pick_and_place(person, temper, lambda number: stream(3, number + 1), range(1))
    return person, draw_stance(rng), plan


def play(case, plan=None, **settings):
    person, stance, own = case
    setting = Setting(RATE_HZ, "a.tsv", np.random.default_rng(0), **settings)
    return play_plan(person, stance, plan or own, setting)


def test_segments_are_the_phases_of_the_script(case):
    capture = play(case)
    script = case[2].arms[RIGHT]
    expected = [
        (round(start * RATE_HZ), round(end * RATE_HZ), phase.label)
        for phase, (start, end) in zip(script.phases, time_phases(script), strict=True)
    ]
    whole = [row for row in zip(*capture.segments.bounds.T, capture.segments.labels, strict=True)
             if not row[2].endswith("_part")]  # fmt: skip
    last = len(capture.recording.time) - 1
    assert whole == [(start, min(end, last), label) for start, end, label in expected]


def test_noise_is_that_of_the_setting_and_hidden_markers_are_not_there(case):
    quiet, noisy = play(case, noise_m=0.0), play(case, noise_m=0.002)
    assert (noisy.recording.positions - quiet.recording.positions).std() == pytest.approx(
        0.002, rel=0.02
    )
    fewer = play(case, hidden=frozenset({"elbow"})).recording
    assert set(quiet.recording.names) - set(fewer.names) == {"Elbow"}


def test_actions_are_layers_over_the_phases(case):
    plan = case[2]
    n = len(plan.arms[RIGHT].phases)
    acting = Plan(
        plan.arms, (Action("fetch", {RIGHT: (1, 5)}), Action("return", {RIGHT: (5, n - 1)}))
    )
    capture = play(case, acting)
    spans = time_phases(plan.arms[RIGHT])
    assert capture.segments.labels == ("fetch", "return")
    assert capture.segments.bounds[:, 0].tolist() == [
        round(spans[1][0] * RATE_HZ), round(spans[5][0] * RATE_HZ),
    ]  # fmt: skip
    np.testing.assert_array_equal(capture.layers["right_hand"].bounds, play(case).segments.bounds)


def test_noise_of_the_joints_moves_the_hand(case):
    shaken = play(case, noise_m=0.0, joint_noise=lambda joints, rate: joints + 0.01)
    still = play(case, noise_m=0.0)
    np.testing.assert_allclose(shaken.body.joints[RIGHT], still.body.joints[RIGHT] + 0.01)
    apart = shaken.body.hands[RIGHT][:, :3] - still.body.hands[RIGHT][:, :3]
    assert 0.001 < np.linalg.norm(apart, axis=1).mean() < 0.05
