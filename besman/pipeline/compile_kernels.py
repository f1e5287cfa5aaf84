"""Compile all kernels once: ``python -m besman.pipeline.compile_kernels``."""

from __future__ import annotations

import tempfile
from pathlib import Path

from besman.config.resources import find_resource
from besman.io.recordings.number_kernel import parse_numbers
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.synthetic.datasets import write_synthetic


def compile_kernels() -> None:
    """Run the default pipeline on one synthetic throw with the smallest budgets.

    What is compiled is kept beside the package, or in the user's cache where that is read-only.
    """
    # The sample is too short for it.
    parse_numbers("1.5\tnan\n", 2)
    with tempfile.TemporaryDirectory() as folder:
        write_synthetic("stick_throw", Path(folder) / "capture", n_subjects=1, n_repetitions=1)
        settings = (
            f"recordings={folder}/capture",
            "recognize.examples_per_class=1",
            "map.evaluations=1",
            "refine.episodes=2",
            "refine.robustness=null",
        )
        config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings)
        run_pipeline(config, Path(folder) / "run")


if __name__ == "__main__":
    compile_kernels()
