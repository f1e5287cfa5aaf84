from __future__ import annotations

import re
import sys

import numpy as np
import pytest

from besman.exceptions import VerificationError
from besman.simulation.second_engine.engines import (
    VERIFIED_KINDS,
    check_engine,
    try_in_second_engine,
)
from besman.simulation.tasks.kinds import load_task


@pytest.mark.parametrize(
    ("engine", "kind", "message"),
    [
        ("bullet", "stick_throw", "--engine: got 'bullet'; allowed: drake"),
        ("drak", "reach", "--engine: got 'drak'; did you mean 'drake'? allowed: drake"),
        (
            "drake",
            "reach",
            "verify: got a run of task reach; drake knows ball_throw, pull_lever or stick_throw",
        ),
    ],
)
def test_what_cannot_be_verified(engine, kind, message):
    with pytest.raises(VerificationError, match=f"^{re.escape(message)}$"):
        check_engine(engine, load_task(kind))


def test_an_engine_that_is_not_installed(monkeypatch):
    monkeypatch.setitem(sys.modules, "pydrake", None)
    message = "verify: pydrake is not installed; pip install 'besman[verify]'"
    with pytest.raises(VerificationError, match=f"^{re.escape(message)}$"):
        check_engine("drake", load_task("stick_throw"))


def test_a_plan_is_judged_by_the_task(puller, pull):
    pytest.importorskip("pydrake", reason="the extra verify is not installed")
    task = load_task("pull_lever")
    check_engine("drake", task)
    plan = task.place(pull, puller)
    trial = try_in_second_engine(puller, task, plan)
    assert trial.success
    assert trial.miss == task.miss(plan, trial.outcome)
    assert np.isfinite(trial.reward)


def test_every_kind_that_is_known_has_a_file():
    assert [load_task(kind).kind for kind in VERIFIED_KINDS] == list(VERIFIED_KINDS)


def test_a_task_that_drake_does_not_know(puller, pull):
    pytest.importorskip("pydrake", reason="the extra verify is not installed")
    with pytest.raises(VerificationError, match=r"^verify: got task reach; expected ball_throw, "):
        try_in_second_engine(puller, load_task("reach"), pull)
