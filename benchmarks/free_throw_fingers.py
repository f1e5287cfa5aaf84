"""Free throws whose fingers are mis-tracked, as in the later session of the SPL open data.

    python benchmarks/free_throw_fingers.py [--throw N] [--markers SET ...]

Ten *synthetic* throws at 60 Hz with that session's 69 names, its keys before the frames, and times
in whole milliseconds. In it joints of fingers lie a third of a metre from their wrist for some
frames while their neighbours are right, two at a time at one false place, and points of a hand are
taken for each other; all of it smoothed. Rows differ in the share of samples that are off. How far
the target lies from that of the same throw unspoilt, how far the hand is from its place there and
how far it is turned (95th percentile, greatest), and what the recipe makes of N throws.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from pathlib import Path

import numpy as np
from free_throw_variants import FOOT_M, RECIPE, throw
from scipy.ndimage import gaussian_filter1d

from besman.geometry.frames import hand_frame
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import load_pipeline
from besman.pipeline.usable_inputs import keep_usable
from besman.stages.read.read_inputs import read_inputs
from besman.synthetic.free_throw import simulate_free_throw

SEED, N_THROWS, RATE_HZ = 21, 10, 60.0
JOINTS = ("MCP", "PIP", "DIP", "DISTAL")
FINGERS = ("SECOND", "THIRD", "FOURTH", "FIFTH")
SMOOTHED_FRAMES = 1.2
OFF_S = 0.15  # a finger is off for so long, in the mean
Paths = dict[str, np.ndarray]


def rename(paths: Paths, rng: np.random.Generator) -> Paths:
    """Give the 27 keypoints the names of the later session, and the hands every joint."""
    toes = {"1STTOE": "BIG_TOE", "5THTOE": "SMALL_TOE", "CALC": "HEEL"}
    sides = {"L": "LEFT", "R": "RIGHT"}
    found: Paths = {"NOSE": paths["NOSE"]}
    for name, path in paths.items():
        side, _, part = name.partition("_")
        if side in sides and "FINGER" not in part:
            found[f"{sides[side]}_{toes.get(part, part)}"] = path
    for short, side in sides.items():
        thumb, little = paths[f"{short}_1STFINGER"], paths[f"{short}_5THFINGER"]
        wrist = paths[f"{short}_WRIST"]
        along = (thumb + little) / 2 - wrist
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        for at, joint in enumerate(("CMC", "MCP", "IP", "DISTAL")):
            place = wrist + (thumb - wrist) * (0.4, 1.0, 1.3, 1.55)[at]
            found[f"{side}_FIRST_FINGER_{joint}"] = place
        for number, finger in enumerate(FINGERS):
            knuckle = thumb + (little - thumb) * (number + 1) / len(FINGERS)
            for at, joint in enumerate(JOINTS):
                beyond = np.array([0.0, 0.04, 0.065, 0.085])[at] / FOOT_M
                found[f"{side}_{finger}_FINGER_{joint}"] = knuckle + beyond * along
    found |= {
        "MID_HIP": (paths["L_HIP"] + paths["R_HIP"]) / 2,
        "NECK": (paths["L_SHOULDER"] + paths["R_SHOULDER"]) / 2,
    }
    return found


def mistrack(paths: Paths, share: float, exchanged: float, rng: np.random.Generator) -> Paths:
    """Let joints of fingers be off for a share of the time, and exchange those of a hand."""
    n = len(paths["NOSE"])
    frames = max(1, round(OFF_S * RATE_HZ))
    found = {name: path.copy() for name, path in paths.items()}
    for side in ("LEFT", "RIGHT"):
        names = [name for name in paths if name.startswith(side) and "_FINGER_" in name]
        for _ in range(rng.poisson(share * n * len(names) / frames / 2)):
            start, length = rng.integers(0, n), rng.geometric(1.0 / frames)
            way = rng.normal(size=3)
            way *= rng.uniform(0.2, 0.4) / FOOT_M / np.linalg.norm(way)
            for name in rng.choice(names, 2, replace=False):
                rows = slice(start, start + length)
                found[name][rows] = paths[f"{side}_WRIST"][rows] + way
        for _ in range(rng.poisson(exchanged * n / frames)):
            start, length = rng.integers(0, n), rng.geometric(1.0 / frames)
            rows = slice(start, start + length)
            for one, other in (("FIRST", "FIFTH"), ("SECOND", "FOURTH")):
                pair = [f"{side}_{finger}_FINGER_MCP" for finger in (one, other)]
                exchanged_places = [found[name][rows].copy() for name in reversed(pair)]
                for name, places in zip(pair, exchanged_places, strict=True):
                    found[name][rows] = places
    for name, path in found.items():
        if "_FINGER_" in name:
            found[name] = gaussian_filter1d(path, SMOOTHED_FRAMES, axis=0, mode="nearest")
    for side in ("LEFT", "RIGHT"):
        found[f"{side}_THUMB"] = found[f"{side}_FIRST_FINGER_MCP"]
        found[f"{side}_PINKY"] = found[f"{side}_FIFTH_FINGER_MCP"]
    return found


def content_of(trial: int, share: float, exchanged: float) -> dict:
    """Return what the file of a throw holds."""
    throw = simulate_free_throw(trial, seed=SEED, rate_hz=RATE_HZ)
    frames = [frame["data"] for frame in throw.content["tracking"]]
    paths = {
        name: np.array([one["player"][name] for one in frames]) for name in frames[0]["player"]
    }
    rng = np.random.default_rng((SEED, trial))
    paths = mistrack(rename(paths, rng), share, exchanged, rng)
    right, away = throw.on_ring_in
    return {
        "sampling_rate": int(RATE_HZ),
        "trial_date": "2025-12-18",
        "participant_id": "P0001",
        "trial_id": f"T{trial:04d}",
        "result": "made",
        "landing_x": round(right, 2),
        "landing_y": round(away, 2),
        "entry_angle": 45.0,
        "tracking": [
            {
                "frame": row,
                "time": int(1000 * row / RATE_HZ),
                "data": {
                    "ball": frame["ball"],
                    "player": {name: path[row].tolist() for name, path in paths.items()},
                },
            }
            for row, frame in enumerate(frames)
        ],
    }


def look_at(contents: list[dict], settings: tuple[str, ...]) -> dict[str, tuple]:
    """Return each throw's target, and its hand: where and along what, by seconds."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for trial, content in enumerate(contents):
            (Path(folder) / f"T{trial}.json").write_text(json.dumps(content))
        config = load_pipeline(RECIPE, (f"recordings={folder}", *settings))
        markers = load_marker_set(config.label.markers)
        inputs, _ = keep_usable(config.label, read_inputs([folder], config=config.read), markers)
        labelled = config.label.run(inputs.recordings, markers, None)
        segments = config.segment.model_copy(update={"markers": markers.hand}).run(labelled)
        chosen = config.select.run(
            labelled, config.recognize.run(labelled, segments), landings=inputs.landings
        )
        hands = {
            one.source: hand_frame(*(one.marker(f"hand_{p}") for p in ("top", "left", "right")))
            for one in labelled
        }
        return {
            name: (one.target[:2] / config.select.target_scale, one.target_by, hands[name])
            for one in chosen
            if (name := one.name.partition(":")[0]) in hands
        }


ROWS = {"unspoilt": (0.0, 0.0), "1 % off": (0.01, 0.0), "3 % off": (0.03, 0.0),
        "10 % off": (0.1, 0.0), "1 % exchanged": (0.0, 0.01),
        "3 % off, 1 %": (0.03, 0.01)}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--throw", type=int, default=0, metavar="N")
    parser.add_argument("--markers", nargs="+", default=["spl"], metavar="SET")
    given = parser.parse_args()
    print(f"{'':30}{'throws':>7}{'target':>10}{'hand, 95 % / max':>22}{'direction':>18}")
    for markers in given.markers:
        settings = (f"label.markers={markers}",)
        plain = look_at([content_of(k, 0.0, 0.0) for k in range(1, N_THROWS + 1)], settings)
        for name, (share, exchanged) in ROWS.items():
            contents = [content_of(k, share, exchanged) for k in range(1, N_THROWS + 1)]
            found = look_at(contents, settings)
            off, away, turned = [], [], []
            for source, (target, _, (axes, middle)) in found.items():
                off.append(np.linalg.norm(target - plain[source][0]))
                true_axes, true_middle = plain[source][2]
                away.append(np.linalg.norm(middle - true_middle, axis=1))
                cosine = np.einsum("tij,tij->t", axes, true_axes) / 2 - 0.5
                turned.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
            far, angle = np.concatenate(away), np.concatenate(turned)
            by = sorted({one[1] for one in found.values()})
            print(
                f"{markers + ', ' + name:30}{len(found):7}{np.max(off):8.3f} m"
                f"{np.nanpercentile(far, 95):12.3f} /{np.nanmax(far):6.3f} m"
                f"{np.nanpercentile(angle, 95):9.1f} /{np.nanmax(angle):6.1f} deg  by "
                f"{', '.join(by)}; {np.isnan(far).mean():.3f} unseen",
                flush=True,
            )
            if given.throw and "off" in name:
                print(f"    thrown: {throw(contents[: given.throw], settings)}", flush=True)


if __name__ == "__main__":
    main()
