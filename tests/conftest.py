import functools

import numpy as np
import pytest

from besman.config.resources import find_resource
from besman.motion.dmp import fit_weights
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.records import MotionPlan
from besman.robot.model import load_robot
from besman.synthetic.datasets import write_synthetic

START = np.array([1.52, -3.75, 0.54, -1.39, -0.70, -0.12])
GOAL = np.array([2.09, -3.15, 0.33, -2.02, -1.48, -0.62])


def throw(robot, duration=0.53, goal=GOAL, name="a", target=(1.5, -0.6, 0.0)):
    x = np.linspace(0, 1, 61)
    blend = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    return MotionPlan(
        weights=fit_weights(x, START + blend * (goal - START), 10),
        start=START,
        goal=goal,
        duration=duration,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=np.array([0.0, 0, 0, 1, 0, 0, 0]),
        target=np.array(target),
        name=name,
        label="throw",
    )


@pytest.fixture(scope="session")
def robot():
    return load_robot("ur5", "stick_holder")


@pytest.fixture(scope="session")
def make_plan(robot):
    """Make a throw of the UR5 that lands about 1.5 m in front of it."""
    return functools.partial(throw, robot)


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    """Three throws of one person (synthetic), refined for a few episodes."""
    folder = tmp_path_factory.mktemp("small")
    write_synthetic("stick_throw", folder / "capture", n_subjects=1, n_repetitions=3, seed=3)
    settings = (
        f"recordings={folder / 'capture'}",
        # Its trajectories have names, which are not looked at.
        "label.method=trajectories",
        "recognize.examples_per_class=2",
        "map.evaluations=60",
        "refine.episodes=25",
        "refine.robustness={models: 2}",
    )
    config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings)
    return run_pipeline(config, folder / "run")
