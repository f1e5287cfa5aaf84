import pytest

from besman.pipeline import load_pipeline, run_pipeline
from besman.resources import find_resource
from besman.synthetic.datasets import write_synthetic


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    """Three throws of one person (synthetic), refined for a few episodes."""
    folder = tmp_path_factory.mktemp("small")
    write_synthetic("stick_throw", folder / "capture", n_subjects=1, n_repetitions=3, seed=3)
    settings = (
        f"recordings={folder / 'capture'}",
        "recognize.examples_per_class=2",
        "map.evaluations=60",
        "refine.episodes=25",
        "refine.robustness={models: 2}",
    )
    config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings)
    return run_pipeline(config, folder / "run")
