from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import PlanError
from besman.stages.imitate.accuracy import NUMBERS, least_weights, measure_error, refuse_if_lost


def series(plan, errors):
    """Give plans with so many weights and the error that goes with them; remember the numbers."""
    asked = []

    def imitate(n_weights):
        asked.append(n_weights)
        weights = np.zeros((len(plan.goal), n_weights))
        return replace(plan, weights=weights, path_error=errors[len(asked) - 1], path_rmse=0.0)

    return imitate, asked


def test_the_least_number_that_is_good_enough(robots, plan_of, demonstrate):
    imitate, asked = series(plan_of("joint_dmp"), [0.02, 0.005, 0.0009, 0.0])
    plan = least_weights(imitate, len(demonstrate(robots["ur5"]).time), 1e-3)
    assert asked == list(NUMBERS[:3])
    assert plan.weights.shape[1] == 40


def test_the_best_of_all_where_none_is_and_no_more_than_samples(robots, plan_of, demonstrate):
    """81 samples: 80 weights are the last that are tried."""
    imitate, asked = series(plan_of("joint_dmp"), [0.02, 0.005, 0.006, 0.007, 0.008])
    plan = least_weights(imitate, len(demonstrate(robots["ur5"]).time), 1e-3)
    assert asked == [20, 30, 40, 60, 80]
    assert plan.weights.shape[1] == 30


def test_without_an_arm_the_distance_is_not_known(robots, plan_of, demonstrate):
    wanted = demonstrate(robots["ur5"])
    plan = measure_error(replace(plan_of("joint_dmp"), path_error=None), wanted, 0.1, None)
    assert plan.path_error is None
    assert plan.rmse > 0
    refuse_if_lost(plan, 1e-9)


def test_what_is_lost_is_refused(plan_of):
    plan = replace(plan_of("joint_dmp"), path_error=0.06)
    refuse_if_lost(plan, None)
    refuse_if_lost(plan, 0.061)
    with pytest.raises(PlanError, match=r"a: not imitated: 20 weights for 1\.1 s .* 60\.0 mm"):
        refuse_if_lost(plan, 0.05)
