import json
from io import StringIO
from threading import Event

import numpy as np
import pytest
from small_runs import keep_demonstrations
from typer.testing import CliRunner

from besman.cli.main import app
from besman.evaluation.counted_episodes import add_episodes, share_done, watched_episodes
from besman.evaluation.names import FUNCTION_NAMES, TASK_RECIPES
from besman.evaluation.refinement import best_rewards, evaluate_refinement, summary
from besman.evaluation.refinement_functions import (
    FUNCTIONS,
    ContextualProblem,
    FunctionProblem,
    sphere,
)
from besman.evaluation.refinement_problems import TaskProblem, load_problem
from besman.evaluation.refinement_tables import refinement_tables, write_curves
from besman.exceptions import ConfigError
from besman.search.kinds import SEARCH_NAMES
from besman.simulation.tasks.kinds import KINDS, load_task
from besman.stages.refine.stage import CmaEsConfig
from besman.work.work import Work
from besman.work.workers import Workers

SMALL = FunctionProblem("small", sphere, 3, 1.0, 1.0, -1e-3, 600, (100,), {"cma_es": -2e-5})


def test_every_search_and_seed_is_a_run():
    result = evaluate_refinement([SMALL], seeds=range(3))
    rows = {row["method"]: row for row in result["rows"]}
    assert list(rows) == list(SEARCH_NAMES)
    row = rows["cma_es"]
    assert (row["dataset"], row["source"], row["n_runs"]) == ("small", "function", 3)
    assert row["n_success"] == 3
    best = [SMALL.attempt("cma_es", seed) for seed in range(3)]
    needed = [int(np.flatnonzero(one.rewards > -1e-3)[0]) + 1 for one in best]
    assert row["episodes"]["median"] == np.median(needed)
    assert row["final_reward"]["mean"] == pytest.approx(
        np.mean([one.rewards.max() for one in best])
    )
    assert row["rewards_at"][100]["mean"] == pytest.approx(
        np.mean([one.rewards[:100].max() for one in best])
    )
    curve = row["curve"]
    assert curve["episodes"][-1] == 600
    assert curve["0.1"][-1] <= curve["0.5"][-1] <= curve["0.9"][-1]
    assert (np.diff(curve["0.5"]) >= 0).all()
    assert row["public"] == -2e-5
    json.dumps(result)


def test_processes_change_nothing():
    alone = evaluate_refinement([SMALL], ["cma_es", "cem"], range(2))
    with Workers(2) as workers:
        spread = evaluate_refinement([SMALL], ["cma_es", "cem"], range(2), Work(2, workers=workers))
    for one, two in zip(alone["rows"], spread["rows"], strict=True):
        assert one["curve"] == two["curve"]


def test_contextual_searches_have_problems_of_their_own():
    problem = ContextualProblem("context", sphere, 5, 1, -0.1, 5000)
    rows = evaluate_refinement([problem, SMALL], ["c_reps", "c_cma_es"], [0])["rows"]
    assert [row["method"] for row in rows] == ["c_reps", "c_cma_es"]
    assert rows[1]["n_success"] == 1
    assert rows[1]["episodes"]["median"] % 50 == 0


def test_imitations_are_refined_as_in_the_stage(robot, make_plan):
    task = load_task("stick_throw")
    from besman.simulation.trial import try_plans

    plan = make_plan(0.54)
    (trial,) = try_plans(robot, task, [plan])
    from dataclasses import replace

    plan = replace(plan, target=trial.outcome + np.array([-0.1, 0.1, 0]))
    problem = TaskProblem("throw", (plan,), robot, task, CmaEsConfig(episodes=20))
    (row,) = evaluate_refinement([problem], ["cma_es"], [0])["rows"]
    (motion,) = CmaEsConfig(episodes=20).run((plan,), robot, task)
    assert row["source"] == "simulation"
    assert row["final_reward"]["median"] == motion.returns.max()
    assert problem.attempt("cma_es", 0).rewards.tolist() == motion.returns.tolist()


def test_best_so_far_stays_and_knows_no_nan():
    np.testing.assert_array_equal(best_rewards([-3, np.nan, -1, -2], 6), [-3, -3, -1, -1, -1, -1])


def test_summary():
    assert summary([]) is None
    found = summary([1.0, 2.0, 3.0, 4.0])
    assert (found["median"], found["q25"], found["q75"], found["mean"]) == (2.5, 1.75, 3.25, 2.5)
    assert found["standard_error"] == pytest.approx(np.std([1, 2, 3, 4], ddof=1) / 2)
    assert summary([2.0])["standard_error"] is None


def test_one_run_alone_has_no_standard_error():
    from rich.console import Console

    rows = evaluate_refinement([SMALL], ["cma_es"], [0])["rows"]
    json.dumps(rows, allow_nan=False)
    console = Console(width=160, record=True, file=StringIO())
    for table in refinement_tables(rows):
        console.print(table)
    text = console.export_text()
    assert "1/1" in text
    assert "nan" not in text
    assert f"{rows[0]['final_reward']['mean']:.3g}" in text


def test_episodes_are_counted_while_attempts_go_on(tmp_path):
    files, budgets = [tmp_path / name for name in "abc"], [10, 20, 5]
    add_episodes(files[0], 4)
    add_episodes(files[0], 1)
    add_episodes(files[2], 9)
    assert share_done(files, budgets) == pytest.approx((0.5 + 0.0 + 1.0) / 3)
    assert share_done([], []) == 0.0
    told, half = [], Event()
    with watched_episodes([8], lambda share: (told.append(share), half.set()), 1e-3) as (file,):
        add_episodes(file, 4)
        while 0.5 not in told:
            half.clear()
            assert half.wait(10)
    assert not file.exists()


def test_a_method_is_refused_before_anything_is_run(monkeypatch):
    """A pipeline takes half a minute until its imitations can be refined."""
    refuse = lambda *arguments, **others: pytest.fail("ran a pipeline")  # noqa: E731
    monkeypatch.setattr("besman.evaluation.refinement_problems.run_pipeline", refuse)
    for options, message in (
        (["rearrange", "--method", "cma_es"], r"--method: got 'cma_es'; .*block_by_block"),
        (["stick_throw", "--method", "nes"], "--method: got 'nes'; .*allowed: cem"),
        (["rearrange", "--problem", "spere"], "--problem: got 'spere'; did you mean 'sphere'"),
    ):
        with pytest.raises(ConfigError, match=message):
            CliRunner().invoke(
                app, ["evaluate", "refinement", "--problem", *options], catch_exceptions=False
            )


def test_the_help_names_every_problem():
    assert tuple(FUNCTIONS) == FUNCTION_NAMES
    assert TASK_RECIPES.keys() <= {entry.name for entry in KINDS}
    for kind, recipe in TASK_RECIPES.items():
        assert recipe in next(entry for entry in KINDS if entry.name == kind).recipes
    told = CliRunner().invoke(app, ["evaluate", "refinement", "--help"], env={"COLUMNS": "1000"})
    for name in (*FUNCTION_NAMES, *TASK_RECIPES):
        assert name in told.output


def test_what_is_not_known_is_refused():
    with pytest.raises(
        ConfigError, match=r"--method: got 'nes'; .*allowed: cem, .*gauss_newton, pi2"
    ):
        evaluate_refinement([SMALL], ["nes"])
    with pytest.raises(ConfigError, match="--problem: got 'spere'; did you mean 'sphere'"):
        load_problem("spere")


def test_command_prints_a_table_and_draws_curves(tmp_path):
    options = ["--problem", "contextual_sphere", "--seeds", "2", "--jobs", "1"]
    files = ["--json", str(tmp_path / "a.json"), "--figures", str(tmp_path)]
    done = CliRunner().invoke(app, ["evaluate", "refinement", *options, *files])
    assert done.exit_code == 0, done.output
    assert "contextual_sphere: 2 runs of 10000 episodes each" in done.output
    rows = json.loads((tmp_path / "a.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["c_reps", "c_cma_es"]
    assert (tmp_path / "contextual_sphere_curves.png").stat().st_size > 10_000


def test_tables_say_when_nothing_succeeded(tmp_path):
    from rich.console import Console

    hard = FunctionProblem("hard", sphere, 3, 1.0, 1.0, 1.0, 40, (20, 40), {})
    rows = evaluate_refinement([hard], seeds=[0, 1])["rows"]
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    for table in refinement_tables(rows):
        console.print(table)
    text = console.export_text()
    assert "0/2" in text
    assert "after 20" in text
    assert "after 40" not in text
    assert len(write_curves(rows, tmp_path / "new")) == 1


@pytest.mark.slow
def test_a_task_is_the_name_of_a_pipeline(monkeypatch):
    found = keep_demonstrations(monkeypatch, 1)
    problem = load_problem("grasp_box", episodes=6)
    assert problem.episodes == 6
    assert (len(found), len(problem.plans)) == (3, 1)
    assert problem.attempt("pi2", 0).rewards.size <= 6
