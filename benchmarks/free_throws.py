"""Free throws from keypoint files to a UR5's throws at the same targets, brought nearer.

    python benchmarks/free_throws.py [FOLDER] [--throws N] [--landing] [--set KEY=VALUE ...]

The files of a folder, or N simulated ones, smoothed as a markerless system smooths them, the hand
hidden for 0.2 s; with other settings than the recipe's, e.g. ``--set refine.method=gauss_newton``.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.synthetic.free_throw import simulate_free_throw

RECIPE = Path(__file__).parents[1] / "pipelines" / "ur5_free_throw.yaml"
FOOT_M = 0.3048
SEED = 77


def spoil(path: np.ndarray, frames: float, noise_m: float, rng: np.random.Generator) -> np.ndarray:
    seen = np.flatnonzero(np.isfinite(path[:, 0]))
    whole = slice(seen[0], seen[-1] + 1)
    path[whole] = gaussian_filter1d(path[whole], frames, axis=0, mode="nearest")
    return np.round(path + rng.normal(0.0, noise_m / FOOT_M, path.shape), 3)


def write_trial(trial: int, folder: Path, has_landing: bool) -> None:
    throw = simulate_free_throw(trial, seed=SEED)
    content = dict(throw.content)
    if has_landing:
        content["landing_x"], content["landing_y"] = throw.on_ring_in
    frames = [frame["data"] for frame in content["tracking"]]
    rng = np.random.default_rng((SEED, trial))
    ball = spoil(np.array([one["ball"] for one in frames]), 2.0, 0.003, rng)
    for one, place in zip(frames, ball.tolist(), strict=True):
        one["ball"] = place
    for name in frames[0]["player"]:
        path = spoil(np.array([one["player"][name] for one in frames]), 1.2, 0.008, rng)
        if name == "R_5THFINGER":
            path[70:76] = np.nan
        for one, place in zip(frames, path.tolist(), strict=True):
            one["player"][name] = place
    (folder / f"BB_FT_P0001_T{trial:04d}.json").write_text(json.dumps(content))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--throws", type=int, default=10)
    parser.add_argument("--landing", action="store_true", help="the files say where each came down")
    parser.add_argument("--set", nargs="+", default=(), dest="settings", metavar="KEY=VALUE")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "trials"
        folder.mkdir()
        if given.folder is not None:
            folder = given.folder
        else:
            for trial in range(1, given.throws + 1):
                write_trial(trial, folder, given.landing)
        settings = (f"recordings={folder}", "refine.robustness=null", *given.settings)
        config = load_pipeline(RECIPE, settings)
        run = run_pipeline(config, Path(temporary) / "run", jobs=2)
        results = json.loads((run / "results.json").read_text())
    refine, told = results["refine"], Counter(results["select"]["target"].values())
    print(f"targets by: {dict(told)}")
    print(f"mapped: {results['map']['n_transferred']} of {results['map']['n_demonstrations']}")
    print(f"hit within {refine['success_radius_m']:g} m: {refine['n_success']}")
    print(f"episodes, median: {refine['episodes']['median']:g}; shared {refine['episodes_shared']}")
    for when in ("miss_before_m", "miss_m"):
        # None where no throw has come down.
        print(f"{when}, median: {refine[when]['median']}")


if __name__ == "__main__":
    main()
