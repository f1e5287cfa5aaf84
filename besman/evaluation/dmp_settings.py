"""Experiment of table 4.1: sequenced DMPs under 48 settings of the priors."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.config.stage import Stage
from besman.records import LabelledRecording, Segments
from besman.stages.segment.bp_ar_hmm import infer_shared_states
from besman.stages.segment.bp_ar_hmm_prior import BpArHmmPrior
from besman.stages.segment.sampling import gather_gapless_paths, sample_paths, to_segments
from besman.stages.segment.scores import score_borders
from besman.stages.segment.signals import prepare_signals
from besman.stages.segment.valley_vmci import find_movements
from besman.stages.segment.vmci import VmciModel, find_change_points, merge_single_samples
from besman.synthetic.sequenced_dmps import SequencedDmps

FloatArray = npt.NDArray[np.float64]

SETTINGS = tuple(product((1.0, 5.0, 10.0, 20.0), (0.1, 1.0, 10.0, 25.0), (4.0, 6.0, 8.0)))
"""D, S and nu of each setting."""

NOISE_M = {"sequenced_dmps": 0.0, "sequenced_dmps_noisy": 0.01}
"""Standard deviation of the noise at 100 Hz by dataset."""

THESIS_FIGURES = {
    "sequenced_dmps": {
        "vmci": (0.97, 1.00, 0.06),
        "mci": (0.34, 0.57, 1.17),
        "bp_ar_hmm": (0.46, 0.26, 0.56),
    },
    "sequenced_dmps_noisy": {
        "vmci": (0.78, 0.86, 0.37),
        "mci": (0.34, 0.50, 0.73),
        "bp_ar_hmm": (0.33, 0.17, 0.52),
    },
}
"""F1, true and false positives of table 4.1; the thesis does not state its margin."""

MARGIN_S = 0.2
RATE_HZ = 20.0
_SWEEPS = 100


def score_settings(
    movements: list[SequencedDmps],
    method: str,
    config: Stage,
    margin_s: float,
    progress: Callable[[float], None],
) -> dict[str, Any]:
    """Score a method under all settings, or under its defaults if it has no such priors.

    Parameters
    ----------
    movements : list of SequencedDmps
        What to segment.
    method : str
        Name of the method.
    config : Stage
        Its stage, for methods without these priors.
    margin_s : float
        Greatest distance of a border that counts as found, seconds.
    progress : callable
        Called with the share done.

    Returns
    -------
    dict
        f1, tp, fp, fn and median_offset_s: means over settings and movements; f1_lowest and
        f1_highest of the settings; n_settings, n_recordings, margin_s, seconds_per_recording.
    """
    recordings = tuple(movement.recording() for movement in movements)
    runs: list[tuple[Segments, ...]] = []
    start = time.perf_counter()
    if method in ("valley_vmci", "vmci", "mci", "bp_ar_hmm"):
        for index, setting in enumerate(SETTINGS):
            runs.append(_segment(movements, method, *setting))
            progress((index + 1) / len(SETTINGS))
    else:
        runs.append(config.run(recordings))  # type: ignore[attr-defined]
    seconds = (time.perf_counter() - start) / (len(runs) * len(movements))
    scores = [
        [
            score_borders(found, movement.truth(), margin_s)
            for found, movement in zip(segments, movements, strict=True)
        ]
        for segments in runs
    ]
    f1 = np.array([[score.f1 for score in row] for row in scores])
    offsets = [s.median_offset_s for row in scores for s in row if np.isfinite(s.median_offset_s)]
    return {
        "f1": float(f1.mean()),
        **{
            key: float(np.mean([[getattr(score, key) for score in row] for row in scores]))
            for key in ("tp", "fp", "fn")
        },
        "f1_lowest": float(f1.mean(axis=1).min()),
        "f1_highest": float(f1.mean(axis=1).max()),
        "median_offset_s": float(np.median(offsets)) if offsets else float("nan"),
        "n_settings": len(runs),
        "n_recordings": len(movements),
        "margin_s": margin_s,
        "seconds_per_recording": seconds,
        "f1_by_recording": f1.mean(axis=0).tolist(),
    }


def _segment(
    movements: list[SequencedDmps], method: str, d: float, s: float, nu: float
) -> tuple[Segments, ...]:
    """Segment movements in the plane under one setting."""
    recordings = [movement.recording() for movement in movements]
    model = VmciModel(
        weight_variance=d, speed_weight_variance=d, noise_scale=s, degrees_of_freedom=nu
    )
    if method == "valley_vmci":
        return tuple(_segment_valleys(recording, model) for recording in recordings)
    signals = [prepare_signals(sample_paths(r, ("hand_top",), RATE_HZ)[0]) for r in recordings]
    # The third coordinate is always zero and would only dilute the noise's prior.
    planes = [each.positions[:, :2] for each in signals]
    if method == "bp_ar_hmm":
        prior = BpArHmmPrior(precision=1.0 / d, noise_scale=s, degrees_of_freedom=nu)
        states = infer_shared_states(planes, _SWEEPS, 0, prior).states
        borders = [
            np.concatenate([[0], np.flatnonzero(np.diff(z)) + 1, [len(z)]]).astype(np.int64)
            for z in states
        ]
    else:
        if method == "mci":
            model = model._replace(n_centres=1)
        borders = [
            find_change_points(
                plane,
                each.speeds if method == "vmci" else np.empty((len(plane), 0)),
                1.0 / len(plane),
                None,
                model,
            ).borders
            for plane, each in zip(planes, signals, strict=True)
        ]
    return tuple(
        to_segments(merge_single_samples(edges), RATE_HZ, recording, float("nan"))
        for edges, recording in zip(borders, recordings, strict=True)
    )


def _segment_valleys(recording: LabelledRecording, model: VmciModel) -> Segments:
    """Segment one movement by the default method; its borders lie on a grid of its own."""
    paths = gather_gapless_paths(recording, ("hand_top",))
    found = find_movements(recording.time, paths, model=model)
    rows = np.unique(np.round(found.borders_s * recording.rate_hz).astype(np.int64))
    return to_segments(rows, recording.rate_hz, recording, found.log_probability)
