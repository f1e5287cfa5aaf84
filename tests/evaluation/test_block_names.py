"""Names of true blocks of a tiny person: learnt ones, and clusters under their best assignment."""

import numpy as np
import pytest

from besman.evaluation.block_names import METHODS, name_blocks, train
from besman.evaluation.demonstrations import cut_demonstrations


@pytest.fixture(scope="module")
def demonstrations(make_steps):
    recording, blocks, actions = make_steps(["step_up", "step_down"] * 4, seed=6)
    return cut_demonstrations(recording, actions, {"right": blocks}, 2)


def test_models_know_the_blocks_of_the_arm_and_the_actions(demonstrations):
    blocks, actions = train(demonstrations[:2])
    assert set(blocks) == {"right"}
    assert set(blocks["right"].labels) == {"up", "down", "left", "right"}
    assert set(actions.labels) == {"step_up", "step_down"}


@pytest.mark.parametrize("method", METHODS)
def test_true_blocks_get_their_names(demonstrations, method):
    models, _ = train(demonstrations[:2])
    tests = [(one, one.blocks) for one in demonstrations[2:]]
    named = name_blocks(tests, models, method, seed=0)
    right = [
        name == truth
        for one, names in zip(demonstrations[2:], named, strict=True)
        for name, truth in zip(names["right"], one.blocks["right"].labels, strict=True)
    ]
    # Clusters know no classes: too many of them split one, and what is left over is idle.
    assert np.mean(right) == 1.0 if method == "vhms" else np.mean(right) > 0.6
