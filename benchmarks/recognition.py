"""Nearest neighbour over 2913 segments, against scikit-learn's; features beside.

Run with ``python benchmarks/recognition.py``. Segments are those of the embedded synthetic sample,
repeated; as in the thesis nine examples of each class are learnt from.
"""

import time

import numpy as np

from besman.classifiers.nearest_neighbour import classify, fit_spread, scale
from besman.config.resources import resource_folder
from besman.evaluation.recognition_data import name_parts
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.features import count_channels
from besman.stages.recognize.stage import RecognizeConfig

N_SEGMENTS = 2913
N_EXAMPLES = 9
ROUNDS = 5


def best(function):
    """Shortest of some rounds, seconds, and the last result."""
    times = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - started)
    return min(times), result


def main():
    from sklearn.neighbors import KNeighborsClassifier

    inputs = read_inputs([str(resource_folder("data") / "stick_throw")])
    recordings = [name_parts(recording) for recording in inputs.recordings]
    candidates = find_candidates(recordings, [t for t in inputs.truth if t], 0.25, 0.4)
    own = [one for one in candidates if one.recording is recordings[0]]
    recipe = RecognizeConfig().make_recipe(recordings, [1])
    bounds = np.resize(np.array([one.bounds for one in own]), (N_SEGMENTS, 2))
    labels = np.resize(np.array([one.label for one in own]), N_SEGMENTS)
    extract_s, values = best(lambda: recipe.extract(recordings[0], bounds))
    values = values + np.random.default_rng(0).normal(scale=1e-3, size=values.shape)
    rows = np.concatenate([np.flatnonzero(labels == c)[:N_EXAMPLES] for c in np.unique(labels)])
    widths = count_channels(recipe.features, recipe.markers)

    def ours():
        scaling = fit_spread(values[rows], widths)
        return classify(scale(values, *scaling), scale(values[rows], *scaling), labels[rows])[0]

    def theirs():
        scaling = fit_spread(values[rows], widths)
        model = KNeighborsClassifier(1).fit(scale(values[rows], *scaling), labels[rows])
        return model.predict(scale(values, *scaling))

    (ours_s, found), (theirs_s, reference) = best(ours), best(theirs)
    print(f"features of {N_SEGMENTS} segments: {1e3 * extract_s:.0f} ms")
    print(f"train on {len(rows)}, label {N_SEGMENTS}: {1e3 * ours_s:.0f} ms")
    print(f"scikit-learn: {1e3 * theirs_s:.0f} ms, ratio {theirs_s / ours_s:.1f}")
    print(f"labels alike: {np.mean(np.array(found) == reference):.1%}")


if __name__ == "__main__":
    main()
