"""The way of the data: every stage once, top to bottom."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from besman.config.settings import own_file
from besman.config.yaml_file import load_config
from besman.exceptions import BesmanError, RecognitionError, RunError, nearest
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.pipeline.compose_step import run_compose
from besman.pipeline.config import (
    PipelineConfig,
    SecondArmConfig,
    learn_from,
    needs_no_examples,
    pipeline_yaml,
)
from besman.pipeline.run_folder import Run
from besman.records import LabelledRecording, LabelledSegments
from besman.records.files import load_record, save_record
from besman.records.layers import side_of
from besman.stages.compose.stage import leave_out_actions
from besman.stages.export.motion_exports import write_exports
from besman.stages.imitate.stage import imitate_results
from besman.stages.label.results import label_results
from besman.stages.map.stage import map_results
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.figures import recognize_results
from besman.stages.recognize.model_files import load_model
from besman.stages.refine.robustness import robustness_results
from besman.stages.refine.stage import refine_results
from besman.stages.segment.figures import segment_results
from besman.work.display import Display
from besman.work.workers import Workers


def run_pipeline(
    config: PipelineConfig,
    folder: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    fresh: str | None = None,
    display: Display | None = None,
    trained_in: Path | None = None,
) -> Path:
    """Run every stage that is not cached, and write results and exports.

    Parameters
    ----------
    config : PipelineConfig
        The recipe.
    folder : Path
        The run folder; made if need be.
    jobs : int
        Threads or processes to use; never changes a result.
    cluster : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``; its workers map and refine.
    fresh : str, optional
        Stage to compute anew.
    display : callable, optional
        Shows progress.
    trained_in : Path, optional
        A finished run whose trained model is used in place of labelled examples.

    Returns
    -------
    Path
        The run folder.

    Raises
    ------
    BesmanError
        As the stages say. The run's status is then ``failed``.
    """
    from threadpoolctl import threadpool_limits

    from besman.robot.model import find_robot

    if fresh is not None and fresh not in STAGES:
        raise RunError(f"--fresh: no stage {fresh!r}; {nearest(fresh, STAGES)}")
    with Workers(jobs, cluster) as workers:
        wall, cpu = time.perf_counter(), time.process_time()
        inputs = read_inputs(config.recordings, learn_from(config))
        run = Run(folder, config.name, jobs=jobs, fresh=fresh, display=display, workers=workers)
        run.start(pipeline_yaml(config), inputs.checksums)
        run.record_time("read", wall, cpu, items=len(inputs.recordings), unit="recordings")
        try:
            # A name that leads nowhere is said before the first stage.
            find_robot(config.robot)
            if config.recognize.model is not None:
                load_model(Path(config.recognize.model))
            # Many small matrices: threads inside BLAS cost more than they bring.
            with threadpool_limits(limits=1, user_api="blas"):
                _run_stages(config, run, inputs, trained_in)
        except BesmanError as error:
            run.finish("failed", str(error))
            raise
        except BaseException as error:
            run.finish("failed", f"{type(error).__name__}: {error}")
            raise
        run.finish()
    return folder


STAGES = (
    "label",
    "segment",
    "train",
    "recognize",
    "train_actions",
    "compose",
    "select",
    "map",
    "imitate",
    "refine",
    "robustness",
)


def _run_stages(config: PipelineConfig, run: Run, inputs: Inputs, trained_in: Path | None) -> None:
    """Run the stages in their order."""
    recordings, truth = inputs.recordings, inputs.truth
    blocks = leave_out_actions(truth, config.compose, side_of(config.segment.markers))
    save_record(blocks, run.folder / "truth.npz")
    markers = load_marker_set(config.label.markers)

    n = len(recordings)
    known = (markers, *inputs.teacher)
    labelled = run.step("label", config.label, recordings, *known, items=n, unit="recordings")
    run.results["label"] = label_results(recordings, labelled, markers, inputs.names)

    segments = run.step("segment", config.segment, labelled, items=n, unit="recordings")
    run.results["segment"] = segment_results(
        segments, blocks, config.segment.markers[0], config.margin_s
    )

    examples = None
    if trained_in is None and not needs_no_examples(config):
        examples = _examples(config, run, labelled, truth, markers)
    model = _train(config, run, examples, trained_in)
    n = sum(len(found.bounds) for found in segments)
    recognized = run.step(
        "recognize", config.recognize, labelled, segments, model, items=n, unit="segments"
    )
    run.results["recognize"] = recognize_results(
        config.recognize, labelled, recognized, blocks, model
    )

    choice = recognized
    if config.compose is not None:
        models = None if trained_in is None else trained_model(trained_in, "train_actions")
        choice = run_compose(
            config.compose, run, (labelled, recognized), examples, models, config.select.action
        )
    n = sum(found.labels.count(config.select.wanted) for found in choice)
    demonstrations = run.step("select", config.select, labelled, choice, items=n, unit="segments")
    run.results["select"] = {"n_demonstrations": len(demonstrations)} | run.left_out("select")

    robot = _load_robot(config)
    if config.second_arm is None:
        n = len(demonstrations)
        mapping = run.step("map", config.map, demonstrations, robot, items=n, unit="demos")
        run.results["map"] = map_results(mapping)
        _learn_motions(config, run, mapping, robot)
        return

    others = run.step(
        "select_second", config.select.other_arm, labelled, choice, items=n, unit="segments"
    )
    robots = (robot, _load_robot(config.second_arm))
    n = len(demonstrations) + len(others)
    mappings = run.step(
        "map", config.map, demonstrations, others, *robots, items=n, unit="demos", method="run_both"
    )
    for mapping, arm, name in zip(mappings, robots, ("", "_second"), strict=True):
        run.results[f"map{name}"] = map_results(mapping)
        _learn_motions(config, run, mapping, arm, name)


def _learn_motions(
    config: PipelineConfig, run: Run, mapping: Any, robot: Any, arm: str = ""
) -> None:
    """Imitate what was mapped to an arm, refine it, and export it."""
    n = len(mapping.trajectories)
    plans = run.step(
        f"imitate{arm}", config.imitate, mapping.trajectories, robot, items=n, unit="motions"
    )
    run.results[f"imitate{arm}"] = imitate_results(plans) | run.left_out(f"imitate{arm}")

    task = _load_task(config)
    n = len(plans)
    # Without what comes after the search: a change of it does not search again.
    search = config.refine.model_copy(update={"robustness": None})
    motions = run.step(f"refine{arm}", search, plans, robot, task, items=n, unit="motions")
    results = refine_results(motions, task) | run.left_out(f"refine{arm}")
    if config.refine.robustness is not None:
        name, n = f"robustness{arm}", len(motions)
        found = run.step(
            name, config.refine.robustness, motions, robot, task, items=n, unit="motions"
        )
        results |= {"robustness": robustness_results(found) | run.left_out(name)}
    run.results[f"refine{arm}"] = results
    folder = run.folder / f"exports{arm}"
    if not _exports_are_current(run, folder, f"refine{arm}"):
        run.work(f"export{arm}", write_exports, motions, robot, folder)


def _exports_are_current(run: Run, folder: Path, stage: str) -> bool:
    """Tell whether whole exports were written after the motions were stored, also past a crash."""
    limits = folder / "limits.json"
    stored = next(run.folder.glob(f"[0-9][0-9]_{stage}/stage.json"))
    return limits.is_file() and limits.stat().st_mtime_ns >= stored.stat().st_mtime_ns


Examples = tuple[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...]]
"""Recordings, and the manual segments of those that have some."""


def _examples(
    config: PipelineConfig,
    run: Run,
    labelled: tuple[LabelledRecording, ...],
    truth: tuple[LabelledSegments | None, ...],
    markers: MarkerSet,
) -> Examples:
    """Return what can be learnt from."""
    if config.training:
        inputs = read_inputs(config.training, learn_from(config))
        n = len(inputs.recordings)
        labelled = run.step(
            "label_training",
            config.label,
            inputs.recordings,
            markers,
            *inputs.teacher,
            items=n,
            unit="recordings",
        )
        truth = inputs.truth
    manual = tuple(segments for segments in truth if segments is not None)
    if not manual:
        raise RecognitionError(
            f"recognize: no labelled examples: none of {len(truth)} recordings has a segments file "
            "beside it (STEM_manually_segmented.json); name recordings that have with training:"
        )
    return labelled, manual


def _train(
    config: PipelineConfig, run: Run, examples: Examples | None, trained_in: Path | None
) -> Any:
    """Return the trained model: a file's, another run's, or one of the labelled examples."""
    if config.recognize.model is not None:
        return load_model(Path(config.recognize.model))
    if examples is None:
        assert trained_in is not None
        return trained_model(trained_in)
    labelled, manual = examples
    blocks = leave_out_actions(manual, config.compose, side_of(config.segment.markers))
    return run.step(
        "train",
        config.recognize,
        labelled,
        tuple(one for one in blocks if one is not None),
        items=config.recognize.examples_per_class,
        unit="a class",
        method="train",
    )


def trained_model(folder: Path, stage: str = "train") -> Any:
    """Load the trained model of a run.

    Parameters
    ----------
    folder : Path
        The run.
    stage : str
        ``train``, or ``train_actions`` for the actions of ``compose``.

    Raises
    ------
    RunError
        If the folder is not a run, or its training has not been done.
    """
    places = sorted(folder.glob(f"[0-9][0-9]_{stage}"))
    if not places:
        raise RunError(f"{folder}: no trained model here: expected a run folder with NN_{stage}")
    return load_record(places[-1] / "record.npz")


def retarget_pipeline(
    folder: Path, recordings: list[Path], robot: str | None = None
) -> PipelineConfig:
    """Return a finished run's recipe for other recordings, and maybe another robot.

    Parameters
    ----------
    folder : Path
        The run.
    recordings : list of Path
        Files or folders.
    robot : str, optional
        A robot's name or the path of a robot.yaml.

    Raises
    ------
    RunError, ConfigError
        If the folder is not a run or the robot is not there.
    """
    if not (folder / "pipeline.yaml").is_file():
        raise RunError(f"{folder}: not a run: pipeline.yaml is missing")
    config = load_config(folder / "pipeline.yaml", PipelineConfig)
    if config.recognize.model is None:
        trained_model(folder)
    changes: dict[str, Any] = {
        "recordings": tuple(str(path.resolve()) for path in recordings),
        "training": (),
    }
    if robot is not None:
        changes["robot"] = own_file(robot, Path.cwd())
    return config.model_copy(update=changes)


def _load_robot(config: PipelineConfig | SecondArmConfig) -> Any:
    from besman.robot.model import load_robot

    return load_robot(config.robot, config.tool)


def _load_task(config: PipelineConfig) -> Any:
    from besman.simulation.tasks.kinds import load_task

    return load_task(config.task)
