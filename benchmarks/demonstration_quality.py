"""Real reaches beside synthetic ones, in the same terms: segmented, mapped, imitated, refined.

Run as ``python benchmarks/demonstration_quality.py [FOLDER]``: pick-and-place recordings with
manual segments, and 12 synthetic ones of the same task, through the recipe `ur5_reach`, once for
each kind of movement.
"""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from pathlib import Path

from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.synthetic import datasets
from besman.synthetic.capture import write_capture

RECIPE = Path(__file__).parents[1] / "pipelines" / "ur5_reach.yaml"
MOVEMENTS = ("approach_forward", "move_obj_table", "approach_right")
N_SUBJECTS = 12


def measure(recordings: Path, label: str, folder: Path) -> dict:
    settings = (f"recordings={recordings}", f"select.label={label}", "refine.robustness=null")
    run = run_pipeline(load_pipeline(RECIPE, settings), folder, jobs=2)
    return json.loads((run / "results.json").read_text())


def row(source: str, label: str, results: dict) -> str:
    mapped, imitated, refined = (results[stage] for stage in ("map", "imitate", "refine"))
    position, turn = mapped["position_error_m"], mapped["orientation_error_deg"]
    return (
        f"| {source} | {label} | {results['segment']['f1']:.3f} "
        f"| {mapped['n_transferred']} of {mapped['n_demonstrations']} "
        f"| {1000 * position['mean']:.1f} / {1000 * position['max']:.1f} "
        f"| {turn['mean']:.1f} / {turn['max']:.1f} | {mapped['time_stretch']['median']:.2f} "
        f"| {imitated['rmse_rad']['mean']:.4f} / {imitated['rmse_rad']['max']:.4f} "
        f"| {refined['n_success']} of {refined['n_motions']} "
        f"| {100 * refined['miss_before_m']['median']:.1f} / "
        f"{100 * refined['miss_m']['median']:.1f} |"
    )


def main() -> None:
    warnings.simplefilter("ignore")
    print("| recordings | movement | F1, 0.3 s | mapped | position error, mean / max, mm "
          "| orientation error, degrees | time stretch | imitation error, rad | succeed "
          "| miss before / after, cm |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        synthetic = Path(temporary) / "synthetic"
        synthetic.mkdir()
        for capture in datasets.captures("pick_and_place", N_SUBJECTS, 1, seed=3):
            write_capture(capture, synthetic)
        real = [("real", Path(folder)) for folder in sys.argv[1:2]]
        for source, folder in (*real, ("*synthetic*", synthetic)):
            for label in MOVEMENTS:
                out = Path(temporary) / f"{folder.name}_{label}"
                print(row(source, label, measure(folder, label, out)), flush=True)


if __name__ == "__main__":
    main()
