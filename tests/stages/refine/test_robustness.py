from dataclasses import replace

import numpy as np
import pytest

from besman.config.stage import Work
from besman.records.files import load_record, save_record
from besman.report.robustness import ROBUSTNESS_HEADER, robustness_cells, robustness_table
from besman.report.terminal import robustness_line
from besman.simulation.perturbation import Spreads
from besman.simulation.perturbed_trials import quarter_step_shift
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.robustness import Robustness, RobustnessConfig, robustness_results
from besman.stages.refine.stage import CmaEsConfig

THROW = load_task("stick_throw")
NONE = dict.fromkeys(Spreads.model_fields, 0.0)


@pytest.fixture(scope="module")
def motions(robot, make_plan):
    plans = [make_plan(0.54, name="a"), make_plan(0.6, name="b")]
    trials = try_plans(robot, THROW, plans)
    plans = [replace(plan, target=trial.outcome) for plan, trial in zip(plans, trials, strict=True)]
    return CmaEsConfig(episodes=1).run(tuple(plans), robot, THROW)


@pytest.fixture(scope="module")
def found(robot, motions):
    return RobustnessConfig(models=10).run(motions, robot, THROW)


def test_every_motion_is_tried_in_every_model(motions, found):
    assert [one.name for one in found] == [motion.plan.name for motion in motions]
    for one in found:
        assert one.success.shape == one.misses.shape == (10,)
        assert 0 < np.nanmedian(one.misses) < 0.1
        assert 0 < one.shift < 0.08
        np.testing.assert_array_equal(one.success, one.misses <= THROW.success_radius_m)


def test_threads_and_company_change_nothing(robot, motions, found):
    threaded = RobustnessConfig(models=10).run(motions, robot, THROW, Work(jobs=3))
    (alone,) = RobustnessConfig(models=10).run(motions[1:], robot, THROW)
    for first, second in ((threaded[0], found[0]), (threaded[1], found[1]), (alone, found[1])):
        np.testing.assert_array_equal(first.misses, second.misses)
        assert first.shift == second.shift


def test_the_shift_is_what_the_search_has_seen(robot, motions):
    for motion, one in zip(
        motions, RobustnessConfig(models=0).run(motions, robot, THROW), strict=True
    ):
        assert motion.success
        assert one.shift == quarter_step_shift(robot, THROW, motion.plan)
        assert one.shift == np.linalg.norm(motion.finer_outcome - motion.outcome)
    # Of a motion whose search has said nothing of the finer step it is simulated.
    unknown = replace(motions[0], finer_outcome=np.full(3, np.nan))
    (found,) = RobustnessConfig(models=0).run((unknown,), robot, THROW)
    assert found.shift == quarter_step_shift(robot, THROW, unknown.plan)


def test_more_models_are_the_same_and_others(robot, motions, found):
    fewer = RobustnessConfig(models=4).run(motions, robot, THROW)
    np.testing.assert_array_equal(fewer[0].misses, found[0].misses[:4])
    (other, _) = RobustnessConfig(models=4, seed=1).run(motions, robot, THROW)
    assert (other.misses != fewer[0].misses).all()


def test_models_that_are_right_give_the_refined_motion(robot, motions):
    (one, _) = RobustnessConfig(models=2, spreads=Spreads(**NONE)).run(motions, robot, THROW)
    np.testing.assert_array_equal(one.misses, motions[0].miss)
    assert one.success.all()


def test_a_motion_without_an_outcome_has_no_figures(robot, make_plan):
    motions = CmaEsConfig(episodes=1).run((make_plan(4.0),), robot, THROW)
    found = RobustnessConfig(models=2).run(motions, robot, THROW)
    results = robustness_results(found)
    assert results["success_share"] == 0.0
    assert results["failed_share"] == 1.0
    assert results["miss_m"] == {"median": None, "p95": None}
    assert results["shift_at_quarter_step_m"] == {"median": None, "max": None}
    assert robustness_cells(found[0]) == ["0 / 2", "", "-"]


def made(success, misses, shift, name="a"):
    return Robustness(name, np.array(success), np.array(misses, dtype=float), shift)


def test_results_are_of_all_episodes():
    found = [made([True, False], [0.01, 0.3], 0.02), made([True, False], [0.03, np.nan], 0.04, "b")]
    results = robustness_results(found)
    assert results["models"] == 2
    assert results["success_share"] == 0.5
    assert results["failed_share"] == 0.25
    assert results["miss_m"]["median"] == pytest.approx(0.03)
    assert results["miss_m"]["p95"] == pytest.approx(np.quantile([0.01, 0.3, 0.03], 0.95))
    assert results["shift_at_quarter_step_m"] == {"median": pytest.approx(0.03), "max": 0.04}
    assert robustness_line(results) == (
        "robustness: 50% succeed in 2 perturbed models each, miss 3.0 cm (median), 27.3 cm (95 %); "
        "3.0 cm elsewhere at a quarter of the time step (median)"
    )
    none = robustness_results([made([], [], 0.02)])
    assert none["success_share"] is None
    assert robustness_line(none).startswith("robustness: 2.0 cm elsewhere")
    assert robustness_results([])["models"] == 0
    lost = robustness_results([made([False], [np.nan], np.nan)])
    assert robustness_line(lost) == "robustness: 0% succeed in 1 perturbed models each"


def test_cells_and_table():
    one = made([True, False], [0.01, 0.3], 0.02)
    assert robustness_cells(one) == ["1 / 2", "28.5 cm", "2.0 cm"]
    assert robustness_cells(None) == [""] * len(ROBUSTNESS_HEADER)
    assert robustness_table([one]).row_count == 1


def test_a_record_comes_back_from_its_file(tmp_path, found):
    save_record(found, tmp_path / "record.npz")
    back = load_record(tmp_path / "record.npz")
    np.testing.assert_array_equal(back[1].misses, found[1].misses)
    assert back[1].success.dtype == np.bool_
    assert not back[1].misses.flags.writeable
