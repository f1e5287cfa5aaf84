import numpy as np

from besman.simulation.perturbation import Spreads
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.transfer.second_simulation import SecondSimulation

THROW = load_task("stick_throw")
NONE = Spreads(**dict.fromkeys(Spreads.model_fields, 0.0))


def test_an_arm_that_is_known_throws_where_the_simulation_says(robot, make_plan):
    (trial,) = try_plans(robot, THROW, [make_plan()])
    arm = SecondSimulation(robot, THROW, 0, NONE)
    np.testing.assert_array_equal(arm.execute(make_plan()), trial.outcome[:2])
    failed = SecondSimulation(robot, THROW, 0, NONE).execute(make_plan(duration=4.0))
    assert np.isnan(failed).all()


def test_another_arm_is_off_always_alike_but_for_its_noise(robot, make_plan):
    (trial,) = try_plans(robot, THROW, [make_plan()])
    one, again, other = (SecondSimulation(robot, THROW, seed) for seed in (1, 1, 2))
    tries = [one.execute(make_plan()) for _ in range(3)]
    assert one.n_tries == 3
    np.testing.assert_array_equal(again.execute(make_plan()), tries[0])
    off = np.linalg.norm(np.mean(tries, axis=0) - trial.outcome[:2])
    spread = np.std(tries, axis=0).max()
    assert 0 < spread < off
    assert not np.array_equal(other.execute(make_plan()), tries[0])
