"""Experiments 1 to 3 of thesis chapter 5: accuracy over examples, settings, new subjects."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.classifiers.kinds import CLASSIFIERS
from besman.classifiers.novelty import UNKNOWN
from besman.evaluation.draws import Draw, draw_balanced, draw_subjects
from besman.evaluation.recognition_data import LabelledSet
from besman.exceptions import ConfigError, nearest
from besman.stages.recognize.model import Examples, classify_features, fit_model
from besman.stages.recognize.stage import CONFIGS, RecognizeConfig

if TYPE_CHECKING:
    from rich.table import Table

Progress = Callable[[float], None]

EXAMPLES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 20)
"""Examples per class (thesis 5.4.2)."""

SETTINGS: dict[str, tuple[str, tuple[int, ...]]] = {
    "nearest_neighbour": ("n_neighbors", (1, 3, 5, 10)),
    "dtw": ("band_points", (1, 3, 5, 10)),
    "hmm": ("n_states", (1, 2, 5, 10)),
    "lstm": ("n_cells", (5, 15, 25, 50)),
}
"""What is varied of each method, and how (thesis 5.4.2)."""

THESIS: dict[tuple[str, str], dict[int, float]] = {
    ("pick_and_place", "nearest_neighbour"): {1: 0.80, 10: 0.975, 20: 0.992},
    ("lever", "nearest_neighbour"): {1: 0.953, 4: 0.99},
    ("lever", "hmm"): {1: 0.421},
    ("ball_throw", "nearest_neighbour"): {1: 0.629, 4: 0.80},
    ("ball_throw", "hmm"): {1: 0.338},
    ("stick_throw", "nearest_neighbour"): {10: 0.88},
    ("stick_throw", "hmm"): {10: 0.70},
    ("stick_throw", "lstm"): {10: 0.94},
    ("gestures", "nearest_neighbour"): {10: 0.67},
    ("gestures", "lstm"): {10: 0.68},
}
"""Mean accuracies that the thesis gives as numbers, by examples per class."""

# A draw of the other methods costs a hundred times as much.
_SLOW_SHARE = 20
_SLOW_EXAMPLES = (1, 5, 10, 20)
_SLOW_TESTS = 200
_SETTING_EXAMPLES = 10
_UNKNOWN_EXAMPLES = (5, 10)


def run_recognition(
    sets: Sequence[LabelledSet],
    methods: Sequence[str],
    draws: int,
    progress: Progress = lambda done: None,
) -> dict[str, Any]:
    """Run the experiments.

    Parameters
    ----------
    sets : sequence of LabelledSet
    methods : sequence of str
        Names out of `besman.stages.recognize.stage.CONFIGS`.
    draws : int
        Random choices of examples; a twentieth of it for methods other than 1-NN.
    progress : callable
        Gets the share done.

    Returns
    -------
    dict
        ``experiment`` and ``rows``; a row has dataset, source, experiment (``examples``,
        ``settings``, ``subjects`` or ``unknown``), method, object_features, examples_per_class,
        draws, accuracy (every segment gets a known class), accuracy_std, per_class, train_s,
        predict_s, n_test, thesis_accuracy (None where the thesis gives no number), extract_s and
        n_left_out (see `LabelledSet`), n_subjects, class_counts (labelled segments). A row of
        ``unknown`` has in place of accuracies and times new_subject, novel_found_share (segments of
        a class that was left out which become unknown) and known_rejected_share (segments of the
        other classes that do).
    """
    tasks = []
    for one in sets:
        variants = [(one, bool(one.recipe.objects))]
        if one.recipe.objects:
            variants.append((one.without_objects(), False))
        tasks += [(variant, method) for variant in variants for method in methods]
    rows: list[dict[str, Any]] = []
    for index, ((one, with_objects), method) in enumerate(tasks):
        n_draws = draws if method == "nearest_neighbour" else max(1, draws // _SLOW_SHARE)
        common = {
            "dataset": one.name,
            "source": one.source,
            "method": method,
            "object_features": with_objects,
        }
        _warm_up(one, method)
        found = [*_over_examples(one, method, n_draws), *_over_settings(one, method, n_draws)]
        found += _over_subjects(one, method, n_draws)
        if method == "nearest_neighbour":
            found += _unknown_classes(one, n_draws)
        classes, counts = np.unique(one.labels, return_counts=True)
        about = {
            "extract_s": one.extract_s,
            "n_left_out": one.n_left_out,
            "n_subjects": len(np.unique(one.subjects)),
            "class_counts": dict(zip(classes.tolist(), counts.tolist(), strict=True)),
        }
        rows += [{**common, **row, **about} for row in found]
        progress((index + 1) / len(tasks))
    return {"experiment": "recognition", "rows": rows}


def check_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """Return methods by name; all whose libraries are installed if none is named.

    Raises
    ------
    ConfigError
        If there is no such method.
    """
    for name in names or ():
        if name not in CONFIGS:
            raise ConfigError(f"--method: no method {name!r}; {nearest(name, CONFIGS)}")
    return tuple(names or (entry.name for entry in CLASSIFIERS if entry.is_installed))


def _warm_up(one: LabelledSet, method: str) -> None:
    """Load and compile what a method needs, which is no part of its times."""
    name, values = SETTINGS[method]
    draw = draw_balanced(one.labels, 1, 0)
    _classify(one, method, Draw(draw.learn, draw.test[:2]), {name: min(values[1], len(draw.learn))})


def _over_examples(one: LabelledSet, method: str, draws: int) -> list[dict[str, Any]]:
    """Experiments 1 and 2: accuracy over examples per class."""
    rows = []
    for n in EXAMPLES if method == "nearest_neighbour" else _SLOW_EXAMPLES:
        chosen = [draw_balanced(one.labels, n, seed) for seed in range(draws)]
        if len(np.unique(one.labels[chosen[0].learn])) >= 2:
            thesis = THESIS.get((one.name, method), {}).get(n)
            rows.append({"experiment": "examples", **_measure(one, method, n, chosen, thesis)})
    return rows


def _over_settings(one: LabelledSet, method: str, draws: int) -> list[dict[str, Any]]:
    """Experiment 2: one parameter of the method varied at ten examples per class."""
    name, values = SETTINGS[method]
    chosen = [draw_balanced(one.labels, _SETTING_EXAMPLES, seed) for seed in range(min(draws, 10))]
    if len(np.unique(one.labels[chosen[0].learn])) < 2:
        return []
    return [
        {
            "experiment": "settings",
            "setting": name,
            "value": value,
            **_measure(one, method, _SETTING_EXAMPLES, chosen, None, {name: value}),
        }
        for value in values
    ]


def _over_subjects(one: LabelledSet, method: str, draws: int) -> list[dict[str, Any]]:
    """Experiment 3: test on a subject of whom nothing was learnt."""
    subjects = np.unique(one.subjects)
    if len(subjects) < 2:
        return []
    rows = []
    each = max(1, min(draws, 10) if method == "nearest_neighbour" else 1)
    for n in (1, 2, 5, 10) if method == "nearest_neighbour" else (1, 5):
        chosen = [
            draw_subjects(one, n, str(subject), seed)
            for subject in subjects
            for seed in range(each)
        ]
        rows.append({"experiment": "subjects", **_measure(one, method, n, chosen, None)})
    return rows


def _unknown_classes(one: LabelledSet, draws: int) -> list[dict[str, Any]]:
    """Leave a class out: how many of its segments become unknown, and how many of the others.

    First with examples of everyone, then tested on a person of whom nothing was learnt.
    """
    seeds = range(min(draws, 10))
    mixed = {n: [draw_balanced(one.labels, n, seed) for seed in seeds] for n in _UNKNOWN_EXAMPLES}
    rows = [{"new_subject": False, **_leave_out(one, n, mixed[n])} for n in mixed]
    subjects = np.unique(one.subjects)
    if len(subjects) > 1:
        n = _UNKNOWN_EXAMPLES[0]
        new = [draw_subjects(one, n, str(who), seed) for who in subjects for seed in seeds[:2]]
        rows.append({"new_subject": True, **_leave_out(one, n, new)})
    return [{"experiment": "unknown", **row} for row in rows if "novel_found_share" in row]


def _leave_out(one: LabelledSet, n: int, chosen: Sequence[Draw]) -> dict[str, Any]:
    """Leave each class out of each draw; return mean shares, nothing if too few classes remain."""
    novel, known = [], []
    for left_out in np.unique(one.labels):
        for draw in chosen:
            learn = draw.learn[one.labels[draw.learn] != left_out]
            own = one.labels[draw.test] == left_out
            if len(np.unique(one.labels[learn])) < 2 or own.all() or not own.any():
                continue
            labels, _, _ = _classify(one, "nearest_neighbour", Draw(learn, draw.test), {}, True)
            rejected = labels == UNKNOWN
            novel.append(float(rejected[own].mean()))
            known.append(float(rejected[~own].mean()))
    if not novel:
        return {}
    return {
        "examples_per_class": n,
        "draws": len(known),
        "novel_found_share": float(np.mean(novel)),
        "known_rejected_share": float(np.mean(known)),
    }


def _measure(
    one: LabelledSet,
    method: str,
    n: int,
    chosen: Sequence[Draw],
    thesis: float | None,
    settings: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Train and test on every draw; return means."""
    accuracy, times, n_test = [], [], 0
    right: dict[str, list[float]] = {}
    for seed, draw in enumerate(chosen):
        test = draw.test
        if method != "nearest_neighbour" and len(test) > _SLOW_TESTS:
            test = np.sort(np.random.default_rng(seed).permutation(test)[:_SLOW_TESTS])
        labels, train_s, predict_s = _classify(one, method, Draw(draw.learn, test), settings or {})
        hits = labels == one.labels[test]
        accuracy.append(float(hits.mean()))
        times.append((train_s, predict_s))
        n_test = max(n_test, len(test))
        for name in np.unique(one.labels[test]):
            right.setdefault(str(name), []).append(float(hits[one.labels[test] == name].mean()))
    return {
        "examples_per_class": n,
        "draws": len(chosen),
        "accuracy": float(np.mean(accuracy)),
        "accuracy_std": float(np.std(accuracy)),
        "per_class": {name: float(np.mean(shares)) for name, shares in right.items()},
        "train_s": float(np.mean([t for t, _ in times])),
        "predict_s": float(np.mean([t for _, t in times])),
        "n_test": n_test,
        "thesis_accuracy": thesis,
    }


def _classify(
    one: LabelledSet, method: str, draw: Draw, settings: dict[str, Any], unknown: bool = False
) -> tuple[npt.NDArray[Any], float, float]:
    """Learn from some rows and name others; return labels and seconds of both."""
    stage = CONFIGS[method](**settings)
    n = len(draw.learn)
    examples = Examples(
        tuple(one.labels[draw.learn].tolist()), ("",) * n, np.zeros((n, 2), dtype=np.int64)
    )
    started = time.perf_counter()
    model = fit_model(
        one.values[draw.learn],
        examples,
        one.recipe,
        method,
        stage.settings,
        RecognizeConfig().unknown_factor if unknown else None,
        with_fallback=False,
    )
    trained = time.perf_counter()
    labels, _ = classify_features(model, one.values[draw.test])
    return np.array(labels), trained - started, time.perf_counter() - trained


def recognition_table(result: dict[str, Any]) -> Table:
    """Return the rows as a table for the terminal."""
    from rich.table import Table

    table = Table("dataset", "method", "ex.", "accuracy", "thesis", "train, test [ms]")
    for row in result["rows"]:
        objects = "" if not row["object_features"] else " + object"
        what = "" if row["experiment"] == "examples" else f", {row['experiment']}"
        setting = f" {row['setting']}={row['value']}" if "setting" in row else ""
        if row["experiment"] == "unknown":
            what += ", new subject" if row["new_subject"] else ""
            novel, known = row["novel_found_share"], row["known_rejected_share"]
            figures = [f"{novel:.0%} of new, {known:.1%} of known", "", ""]
        else:
            thesis = row["thesis_accuracy"]
            figures = [
                f"{row['accuracy']:.1%} ± {row['accuracy_std']:.1%}",
                "" if thesis is None else f"{thesis:.1%}",
                f"{1e3 * row['train_s']:.0f}, {1e3 * row['predict_s']:.0f}",
            ]
        table.add_row(
            f"{row['dataset']} ({row['source']})",
            f"{row['method']}{objects}{what}{setting}",
            str(row["examples_per_class"]),
            *figures,
        )
    return table
