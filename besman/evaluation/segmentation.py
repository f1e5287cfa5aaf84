"""Experiment: segmentation methods beside each other, as tables 4.1 to 4.4 of the thesis.

Times are of one recording on one core, data at hand and kernels compiled; methods that take all
recordings together share theirs out equally.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.config.stage import Stage, Work
from besman.evaluation.dmp_settings import (
    MARGIN_S,
    NOISE_M,
    RATE_HZ,
    THESIS_FIGURES,
    score_settings,
)
from besman.evaluation.segmentation_data import (
    SIMULATED,
    SegmentedDataset,
    read_dataset,
    simulate_dataset,
)
from besman.exceptions import ConfigError, nearest
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.records.layers import drop_parts
from besman.stages.segment.methods import CONFIGS
from besman.stages.segment.scores import mean_score, score_borders
from besman.synthetic import sequenced_dmps

FloatArray = npt.NDArray[np.float64]
Found = dict[str, tuple[Segments, ...]]

_N_RESAMPLES = 2000
_INTERVAL = (2.5, 97.5)


def evaluate_segmentation(
    data: Path | None = None,
    methods: Sequence[str] | None = None,
    margin_s: float | None = None,
    seed: int = 0,
    figures: Path | None = None,
    source: str = "real",
    progress: Callable[[float], None] = lambda done: None,
) -> dict[str, Any]:
    """Measure segmentation methods.

    Parameters
    ----------
    data : Path, optional
        Folder of recordings with manual segments beside them. Only these are measured then;
        otherwise the simulated datasets.
    methods : sequence of str, optional
        Names of methods; all if not given.
    margin_s : float, optional
        Greatest distance of a border that counts as found, seconds; that of the thesis if not
        given.
    seed : int
        Of the simulated data and of the bootstrap.
    figures : Path, optional
        Folder for figures of the recordings.
    source : str
        ``real`` or ``synthetic``, what the recordings in `data` are.
    progress : callable
        Called with the share done.

    Returns
    -------
    dict
        ``experiment`` and ``rows``: one for each dataset and method, see `score_method`.

    Raises
    ------
    BesmanError
        If there is no such method or the data cannot be used.
    """
    names = choose_methods(methods)
    if margin_s is not None and not margin_s >= 0.0:
        raise ConfigError(f"evaluate segmentation: margin_s: got {margin_s}; must not be negative")
    datasets: list[SegmentedDataset | str] = []
    if data is not None:
        datasets.append(read_dataset(data, source))
    else:
        datasets += list(NOISE_M)
        datasets += [simulate_dataset(name, seed) for name in SIMULATED]
    warm = _warm_up_recordings(seed)
    for name in names:
        make_method(name, {}).run(warm)  # type: ignore[attr-defined]
    rows: list[dict[str, Any]] = []
    n_steps = len(datasets) * len(names)
    for dataset in datasets:
        found: Found = {}
        for name in names:
            done = len(rows)

            def step(share: float, done: int = done) -> None:
                progress((done + share) / n_steps)

            if isinstance(dataset, str):
                rows.append(_score_dmps(dataset, name, margin_s, seed, step))
            else:
                row, found[name] = score_method(dataset, name, margin_s, seed, step)
                rows.append(row)
            progress(len(rows) / n_steps)
        if figures is not None and not isinstance(dataset, str):
            from besman.evaluation.segmentation_figures import draw_dataset

            draw_dataset(dataset, found, figures)
    return {"experiment": "segmentation", "rows": rows}


def _warm_up_recordings(seed: int) -> tuple[Any, ...]:
    """Return one short recording, for compiling kernels before anything is timed."""
    return (sequenced_dmps.generate_sequenced_dmps(seed=seed)[0].recording(),)


def choose_methods(methods: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of methods, all by default; refuse unknown ones."""
    for name in methods or ():
        if name not in CONFIGS:
            raise ConfigError(
                f"evaluate segmentation: no method {name!r}; {nearest(name, CONFIGS)}"
            )
    return tuple(dict.fromkeys(methods or CONFIGS))


def make_method(name: str, settings: dict[str, Any]) -> Stage:
    """Make the stage of a method with those of the settings that it has."""
    config = CONFIGS[name]
    return config(**{key: value for key, value in settings.items() if key in config.model_fields})


def score_method(
    dataset: SegmentedDataset,
    name: str,
    margin_s: float | None,
    seed: int,
    progress: Callable[[float], None],
) -> tuple[dict[str, Any], tuple[Segments, ...]]:
    """Run a method on a dataset and score it.

    Returns
    -------
    row : dict
        dataset, source, method; f1, tp, fp, fn, median_offset_s of internal borders, f1_low and
        f1_high (95 % bootstrap interval over recordings); f1_end, tp_end, fp_end with the end of
        a recording counted, as the thesis does; accuracy of labels for methods that cluster, None
        for others; margin_s, n_recordings, seconds_per_recording; recordings, the figures of each;
        thesis, those of the thesis on its own data, None where there are none.
    segments : tuple of Segments
    """
    margin = dataset.table.margin_s if margin_s is None else margin_s
    settings = {"rate_hz": dataset.table.rate_hz, **dataset.settings.get(name, {})}
    stage = make_method(name, settings)
    start = time.perf_counter()
    segments, labelled = _run(stage, dataset.recordings, Work(progress=progress))
    seconds = (time.perf_counter() - start) / len(segments)
    inner = mean_score(segments, dataset.truth, margin)
    end = mean_score(segments, dataset.truth, margin, count_end=True)
    each = [
        score_borders(found, true, margin)
        for found, true in zip(segments, dataset.truth, strict=True)
    ]
    low, high = bootstrap_mean([score.f1 for score in each], seed)
    accuracy = None if labelled is None else cluster_accuracy(labelled, dataset.truth)
    thesis = dataset.table.figures.get(name)
    known = dataset.name in SIMULATED
    row = {
        "dataset": dataset.name,
        "source": dataset.source,
        "method": name,
        "f1": inner.f1,
        "f1_low": low,
        "f1_high": high,
        "tp": inner.tp,
        "fp": inner.fp,
        "fn": inner.fn,
        "median_offset_s": inner.median_offset_s,
        "f1_end": end.f1,
        "tp_end": end.tp,
        "fp_end": end.fp,
        "accuracy": accuracy,
        "margin_s": margin,
        "n_recordings": len(segments),
        "seconds_per_recording": seconds,
        "recordings": [
            {"recording": found.source, "f1": s.f1, "tp": s.tp, "fp": s.fp, "fn": s.fn}
            for found, s in zip(segments, each, strict=True)
        ],
        "thesis": _thesis(dataset.table.number, thesis) if known else None,
    }
    return row, segments


def _run(
    stage: Stage, recordings: tuple[LabelledRecording, ...], work: Work
) -> tuple[tuple[Segments, ...], tuple[LabelledSegments, ...] | None]:
    """Run a method once; a method that clusters gives its labels as well."""
    if not hasattr(stage, "run_labelled"):
        return stage.run(recordings, work), None  # type: ignore[attr-defined]
    labelled = stage.run_labelled(recordings, work)
    segments = tuple(
        Segments(each.bounds, float("nan"), each.rate_hz, each.source, each.first_frame)
        for each in labelled
    )
    return segments, labelled


def _score_dmps(
    dataset: str,
    name: str,
    margin_s: float | None,
    seed: int,
    progress: Callable[[float], None],
) -> dict[str, Any]:
    """Score a method on sequenced DMPs."""
    movements = sequenced_dmps.generate_sequenced_dmps(NOISE_M[dataset], seed=seed)
    margin = MARGIN_S if margin_s is None else margin_s
    stage = make_method(name, {"rate_hz": RATE_HZ})
    figures = score_settings(movements, name, stage, margin, progress)
    by_recording = figures.pop("f1_by_recording")
    low, high = bootstrap_mean(by_recording, seed)
    accuracy = None
    if hasattr(stage, "run_labelled"):
        found = stage.run_labelled(tuple(movement.recording() for movement in movements))
        accuracy = cluster_accuracy(found, tuple(movement.truth() for movement in movements))
    return {
        "dataset": dataset,
        "source": "synthetic",
        "method": name,
        **figures,
        "f1_low": low,
        "f1_high": high,
        "accuracy": accuracy,
        "recordings": [
            {"recording": movement.name, "f1": f1}
            for movement, f1 in zip(movements, by_recording, strict=True)
        ],
        "thesis": _thesis("4.1", THESIS_FIGURES[dataset].get(name)),
    }


def _thesis(number: str, figures: tuple[float, float, float] | None) -> dict[str, Any] | None:
    if figures is None:
        return None
    f1, tp, fp = figures
    return {"table": number, "f1": f1, "tp": tp, "fp": fp, "measured_on": "other data"}


def bootstrap_mean(values: Sequence[float], seed: int) -> tuple[float, float]:
    """Return the 95 % percentile interval of the mean of values, resampled with a seed."""
    x = np.asarray(values, dtype=np.float64)
    rng = np.random.default_rng(seed)
    means = x[rng.integers(len(x), size=(_N_RESAMPLES, len(x)))].mean(axis=1)
    low, high = np.percentile(means, _INTERVAL)
    return float(low), float(high)


def cluster_accuracy(
    found: tuple[LabelledSegments, ...], truth: tuple[LabelledSegments, ...]
) -> float:
    """Share of the labelled time in which the cluster stands for the true label.

    Clusters are matched to labels one to one, so that the share is greatest.

    Parameters
    ----------
    found : tuple of LabelledSegments
        Clusters, the same names in all recordings.
    truth : tuple of LabelledSegments
        True segments; parts of segments and stretches without a label are left out.

    Returns
    -------
    float
        0 to 1; NaN if nothing is labelled.
    """
    from scipy.optimize import linear_sum_assignment

    clusters = sorted({label for each in found for label in each.labels})
    labels = sorted({label for each in truth for label in drop_parts(each).labels})
    overlap = np.zeros((len(clusters), len(labels)))
    total = 0.0
    for segments, manual in zip(found, truth, strict=True):
        whole = drop_parts(manual)
        for (start, end), label in zip(whole.bounds, whole.labels, strict=True):
            total += (end - start) / whole.rate_hz
            for (first, last), cluster in zip(segments.bounds, segments.labels, strict=True):
                shared = max(0, min(end, last) - max(start, first)) / whole.rate_hz
                overlap[clusters.index(cluster), labels.index(label)] += shared
    rows, columns = linear_sum_assignment(-overlap)
    return float(overlap[rows, columns].sum() / total) if total else float("nan")
