import numpy as np
import pytest

from besman.exceptions import RunError
from besman.pipeline.finished_run import read_run
from besman.pipeline.robustness_of_run import check_robustness
from besman.stages.refine.robustness import RobustnessConfig, robustness_results


def test_the_motions_of_a_run_are_tried_as_the_config_says(small_run, tmp_path):
    config = RobustnessConfig(models=2, seed=5)
    found, results = check_robustness(small_run, config)
    finished = read_run(small_run)
    direct = config.run(finished.motions, finished.robot, finished.task)
    for one, other in zip(found, direct, strict=True):
        np.testing.assert_array_equal(one.misses, other.misses)
    assert results["run"] == small_run.name
    assert results["config"]["models"] == 2
    expected = robustness_results(direct)
    assert {key: results[key] for key in expected} == expected
    assert [one["motion"] for one in results["motions"]] == [one.name for one in direct]
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        check_robustness(tmp_path, config)
