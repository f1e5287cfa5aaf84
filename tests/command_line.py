"""Run a command of besman within the tests' process."""

import pytest

from besman.cli import main as cli


def besman(monkeypatch, *arguments):
    """Run a command; return its exit code."""
    monkeypatch.setattr("sys.argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return caught.value.code or 0


def leave_undrawn(monkeypatch):
    """Have reports made without rendering their figures: half of the time of a short run.

    What is drawn is shown by the small run and by the tests of the report, the tasks and the views.
    """
    canvas = "matplotlib.backends.backend_svg.FigureCanvasSVG.print_svg"
    monkeypatch.setattr("besman.report.figures._settle_layout", lambda figure: None)
    monkeypatch.setattr(canvas, lambda self, file, **options: file.write("<svg></svg>"))


# What makes the run below quick: it changes neither which stages there are nor what they promise.
SMALL_RUN = (
    # Its trajectories have names, which are not looked at.
    "label.method=trajectories",
    "recognize.examples_per_class=2",
    "map.evaluations=60",
    "map.yaw=false",
    "refine.episodes=100",
    "refine.robust=null",
    "refine.robustness={models: 5}",
)


def run_small(folder):
    """Write a capture of three throws (synthetic), and run the default pipeline on it."""
    # Not for the process that only hands out the tests: it takes a second to load.
    from besman.synthetic.datasets import write_synthetic

    write_synthetic("stick_throw", folder / "capture", n_subjects=1, n_repetitions=3, seed=8)
    arguments = ["run", "ur5_stick_throw", "--out", folder / "run"]
    for setting in (f"recordings={folder / 'capture'}", *SMALL_RUN):
        arguments += ["--set", setting]
    with pytest.MonkeyPatch.context() as patch:
        assert besman(patch, *arguments) == 0
