"""Free throws as real files may have them: which still tell their targets, and how well.

Run as ``python benchmarks/free_throw_variants.py [--throw N] [NAME ...]``. Ten *synthetic* throws
in the layout of the SPL open data, spoilt in one way a row; read, labelled, recognized and selected
as the recipe `ur5_free_throw` says. A target counts as told if it was by the ball; its error is how
far it lies from that of the same throw unspoilt, before it is brought nearer. With ``--throw N``
the first N of each row go through the whole recipe: how many are mapped and hit, and what it took.
"""

from __future__ import annotations

import argparse
import copy
import json
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from besman.exceptions import BesmanError
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.usable_inputs import keep_usable
from besman.stages.read.read_inputs import read_inputs
from besman.synthetic.free_throw import simulate_free_throw

RECIPE = Path(__file__).parents[1] / "pipelines" / "ur5_free_throw.yaml"
FOOT_M = 0.3048
SEED, N_THROWS = 9, 10
Paths = dict[str, np.ndarray]
Change = Callable[[Paths, np.random.Generator], Paths]


def jitter(noise_m: float) -> Change:
    return lambda paths, rng: {
        name: path + rng.normal(0.0, noise_m / FOOT_M, path.shape) for name, path in paths.items()
    }


def scaled(factor: float) -> Change:
    return lambda paths, rng: {name: factor * path for name, path in paths.items()}


def dropped(share: float) -> Change:
    def change(paths: Paths, rng: np.random.Generator) -> Paths:
        for path in paths.values():
            path[rng.random(len(path)) < share] = np.nan
        return paths

    return change


def hidden(paths: Paths, rng: np.random.Generator) -> Paths:
    for name in ("R_WRIST", "R_ELBOW", "R_1STFINGER", "R_5THFINGER", "L_SHOULDER"):
        start = rng.integers(10, 100)
        paths[name][start : start + 10] = np.nan
    return paths


def never_seen(part: str) -> Change:
    return lambda paths, rng: {
        name: np.full_like(path, np.nan) if part in name else path for name, path in paths.items()
    }


def lifted(paths: Paths, rng: np.random.Generator) -> Paths:
    return {
        name: np.stack([path[:, 0], path[:, 2], -path[:, 1]], axis=1)
        for name, path in paths.items()
    }


def jumping(paths: Paths, rng: np.random.Generator) -> Paths:
    for path in paths.values():
        for row in rng.integers(0, len(path), 2):
            path[row] += rng.normal(0.0, 2.0, 3)
    return paths


def lost_early(paths: Paths, rng: np.random.Generator) -> Paths:
    seen = np.flatnonzero(np.isfinite(paths["ball"][:, 0]))
    paths["ball"][seen[-4:]] = np.nan
    return paths


def left_handed(paths: Paths, rng: np.random.Generator) -> Paths:
    other = {"R_": "L_", "L_": "R_"}
    return {other.get(name[:2], name[:2]) + name[2:]: path * [1, -1, 1]
            for name, path in paths.items()}  # fmt: skip


def passed_to_the_person(paths: Paths, rng: np.random.Generator) -> Paths:
    """Let the ball come by a pass from below the ring for two seconds before; badly seen first."""
    n_before, arrives_s, flight_s = 60, 1.6, 0.9
    ball, gravity = paths["ball"], np.array([0.0, 0.0, -9.81 / FOOT_M])
    held = ball[np.flatnonzero(np.isfinite(ball[:, 0]))[0]]
    start = np.array([38.0, 0.5, 4.5])
    velocity = (held - start - 0.5 * gravity * flight_s**2) / flight_s
    time_s = np.arange(n_before) / 30.0
    since = (time_s - arrives_s + flight_s)[:, None]
    coming = start + velocity * since + 0.5 * gravity * since**2
    coming[since[:, 0] < 0.45] = np.nan
    coming[time_s >= arrives_s] = held
    first = np.flatnonzero(np.isfinite(coming[:, 0]))[:4]
    coming[first] += rng.normal(0.0, 1.5, (len(first), 3))
    ball[:20] = np.where(np.isnan(ball[:20]), held, ball[:20])
    stands = {name: path[:1] + rng.normal(0.0, 0.01, (n_before, 3)) for name, path in paths.items()}
    stands["ball"] = coming
    return {name: np.concatenate([stands[name], path]) for name, path in paths.items()}


def walks_off(paths: Paths, rng: np.random.Generator) -> Paths:
    """Let the person go back by 1.2 m in the three seconds after."""
    share = np.linspace(0.0, 1.0, 91)[1:, None]
    way = (10 * share**3 - 15 * share**4 + 6 * share**5) * np.array([-4.0, 0.5, 0.0])
    after = {
        name: path[-1:] + way + rng.normal(0.0, 0.01, way.shape) for name, path in paths.items()
    }
    return {name: np.concatenate([path, after[name]]) for name, path in paths.items()}


def badly_seen_ball(paths: Paths, rng: np.random.Generator) -> Paths:
    """Spoil the last frames of the ball, and see another thing for three frames later."""
    ball = paths["ball"]
    last = int(np.flatnonzero(np.isfinite(ball[:, 0]))[-1])
    ball[last - 2 : last + 1] += rng.normal(0.0, 0.5, (3, 3))
    other = slice(last + 9, last + 12)
    ball[other] = np.array([30.0, 5.0, 3.0]) + rng.normal(0.0, 1.0, ball[other].shape)
    return paths


def together(*changes: Change) -> Change:
    def change(paths: Paths, rng: np.random.Generator) -> Paths:
        for one in changes:
            paths = one(paths, rng)
        return paths

    return change


FOLLOW_LEFT = ("recognize.arm=left", "select.arm=left")
VARIANTS: dict[str, tuple[Change, tuple[str, ...]]] = {
    "inches": (scaled(12.0), ()),
    "metres": (scaled(FOOT_M), ()),
    "y up": (lifted, ()),
    "left-handed, arm=left": (left_handed, FOLLOW_LEFT),
    "no rate, rate_hz=30": (lambda paths, rng: paths, ("read.rate_hz=30",)),
    "jitter of 1 cm": (jitter(0.01), ()),
    "jitter of 2 cm": (jitter(0.02), ()),
    "one in ten keypoints dropped": (dropped(0.1), ()),
    "one in four dropped": (dropped(0.25), ()),
    "arm hidden for 0.33 s": (hidden, ()),
    "two jumps of 0.6 m each": (jumping, ()),
    "no finger at all": (never_seen("FINGER"), ()),
    "ball lost 4 frames earlier": (lost_early, ()),
    "no ball": (never_seen("ball"), ()),
    "a pass before the throw": (passed_to_the_person, ()),
    "walks off after it": (walks_off, ()),
    "pass, ball badly seen, walks off": (
        together(badly_seen_ball, passed_to_the_person, walks_off), ()),
    "y up, 1.5 cm, dropped, hidden": (
        together(jitter(0.015), dropped(0.1), hidden, lifted), ()),
}  # fmt: skip


def spoil(content: dict, change: Change, name: str, trial: int) -> dict:
    content = copy.deepcopy(content)
    frames = [frame["data"] for frame in content["tracking"]]
    names = [*frames[0]["player"], "ball"]
    paths = {
        one: np.array(
            [frame["ball"] if one == "ball" else frame["player"][one] for frame in frames]
        )
        for one in names
    }
    paths = change(paths, np.random.default_rng((SEED, trial, len(name))))
    ball = paths.pop("ball").tolist()
    content["tracking"] = [
        {
            "frame": row,
            "time": int(1000 * row / 30),
            "data": {
                "ball": place,
                "player": {one: path[row].tolist() for one, path in paths.items()},
            },
        }
        for row, place in enumerate(ball)
    ]
    if name.startswith("no rate"):
        for frame in content["tracking"]:
            frame.pop("time")
    return content


def find_targets(contents: list[dict], settings: tuple[str, ...]) -> dict[str, tuple]:
    """Return the target of each throw in the person's frame, and what told it."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for trial, content in enumerate(contents):
            (Path(folder) / f"T{trial}.json").write_text(json.dumps(content))
        config = load_pipeline(RECIPE, (f"recordings={folder}", *settings))
        markers = load_marker_set(config.label.markers)
        inputs = read_inputs([folder], config=config.read)
        inputs, _ = keep_usable(config.label, inputs, markers)
        labelled = config.label.run(inputs.recordings, markers, None)
        segments = config.segment.model_copy(update={"markers": markers.hand}).run(labelled)
        chosen = config.select.run(labelled, config.recognize.run(labelled, segments))
        return {
            one.name.partition(":")[0]: (one.target[:2] / config.select.target_scale, one.target_by)
            for one in chosen
        }


def throw(contents: list[dict], settings: tuple[str, ...]) -> str:
    """Run the recipe; say what became of the throws."""
    with tempfile.TemporaryDirectory() as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(temporary) / "throws"
        folder.mkdir()
        for trial, content in enumerate(contents):
            (folder / f"T{trial}.json").write_text(json.dumps(content))
        settings = (f"recordings={folder}", "refine.robustness=null", *settings)
        run = run_pipeline(load_pipeline(RECIPE, settings), Path(temporary) / "run", jobs=2)
        results = json.loads((run / "results.json").read_text())
    mapped, refine = results["map"], results["refine"]
    return (
        f"{mapped['n_transferred']} of {mapped['n_demonstrations']} mapped, {refine['n_success']} "
        f"hit within {refine['success_radius_m']:g} m, miss before / after "
        f"{refine['miss_before_m']['median']:.3f} / {refine['miss_m']['median']:.3f} m, "
        f"{refine['episodes']['median']:g} episodes (medians)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(VARIANTS))
    parser.add_argument("--throw", type=int, default=0, metavar="N")
    given = parser.parse_args()
    asked = given.names or list(VARIANTS)
    throws = [dict(simulate_free_throw(k, seed=SEED).content) for k in range(1, N_THROWS + 1)]
    plain = find_targets(throws, ())
    print(f"{'':32}{'throws':>8}{'by ball':>9}{'median':>9}{'max':>8}")
    for name in asked:
        change, settings = VARIANTS[name]
        contents = [spoil(one, change, name, trial) for trial, one in enumerate(throws)]
        try:
            found = find_targets(contents, settings)
        except BesmanError as error:
            print(f"{name:32}{error}")
            continue
        mirror = np.array([1.0, -1.0 if name.startswith("left") else 1.0])
        errors = [
            np.linalg.norm(mirror * place - plain[source][0])
            for source, (place, by) in found.items()
            if by in ("object", "flight")
        ]
        middle, most = (np.median(errors), np.max(errors)) if errors else (np.nan, np.nan)
        print(f"{name:32}{len(found):8}{len(errors):9}{middle:7.2f} m{most:6.2f} m", flush=True)
        if given.throw:
            print(f"    thrown: {throw(contents[: given.throw], settings)}", flush=True)


if __name__ == "__main__":
    main()
