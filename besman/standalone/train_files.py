"""Training without a pipeline."""

from __future__ import annotations

from pathlib import Path

from besman.config.settings import parse_setting
from besman.config.stage import Config
from besman.config.yaml_file import parse_config
from besman.exceptions import RecognitionError
from besman.io.recordings.folders import find_recordings
from besman.io.segments_json import segments_path
from besman.person.marker_set import load_marker_set
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.model_files import check_model_place, save_model
from besman.stages.recognize.stage import TrainedStage
from besman.standalone import LONGEST_GAP_S


class _Training(Config):
    recognize: TrainedStage


def train_files(
    paths: list[Path],
    out: Path,
    markers: str,
    settings: tuple[str, ...],
    learn_from: Path | None = None,
) -> tuple[Path, Path]:
    """Learn from recordings and their manual segments, and write the model.

    Parameters
    ----------
    paths : list of Path
        Recordings, segments files beside them, or folders.
    out : Path
        See `besman.stages.recognize.model_files.save_model`.
    markers : str
        Marker set.
    settings : tuple of str
        ``KEY=VALUE`` of the pipeline's section ``recognize``.
    learn_from : Path, optional
        A recording with names, by which trajectories without names are named.

    Returns
    -------
    pair of Path
        What was written.

    Raises
    ------
    BesmanError
        If a file cannot be read, nothing is labelled, or a setting does not fit.
    """
    content = dict(parse_setting(setting, "method=hmm") for setting in settings)
    check_model_place(out)
    stage = parse_config({"recognize": content}, _Training, "besman train").recognize
    teacher = None if learn_from is None else str(learn_from)
    inputs = read_inputs([str(_recording(path)) for path in paths], teacher)
    truth = tuple(segments for segments in inputs.truth if segments is not None)
    if not truth:
        raise RecognitionError(
            f"{paths[0]}: nothing is labelled; expected STEM_manually_segmented.json beside "
            "STEM.tsv"
        )
    label = DefaultLabelConfig(markers=markers, longest_gap_s=LONGEST_GAP_S)
    recordings = label.run(inputs.recordings, load_marker_set(markers), inputs.teacher)
    return save_model(stage.train(recordings, truth), out)


def _recording(path: Path) -> Path:
    """Return the recording that a segments file belongs to; any other path as it is."""
    if path.suffix != ".json" or not path.is_file():
        return path
    for recording in find_recordings([path.parent]):
        if segments_path(recording) == path:
            return recording
    raise RecognitionError(f"{path}: no recording beside this segments file")
