"""``besman evaluate``: tables of the thesis, measured on given or simulated data."""

from pathlib import Path
from typing import Annotated

import typer

from besman.classifiers.kinds import CLASSIFIER_NAMES
from besman.cli.options import ALL_CORES, Figures, Jobs, Json, target_folder
from besman.evaluation.names import (
    FUNCTION_NAMES,
    HIERARCHY_NAMES,
    TASK_RECIPES,
    WHOLE_TASK_RECIPES,
    WHOLE_TASK_SEARCHES,
)
from besman.search.kinds import CONTEXTUAL_NAMES, SEARCH_NAMES
from besman.stages.segment.kinds import SEGMENTATION_NAMES

evaluate_app = typer.Typer(
    help="Measure a table of the thesis on given data.", no_args_is_help=True
)


@evaluate_app.command("segmentation")
def evaluate_segmentation(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with manual segments; simulated data if not given."
        ),
    ] = None,
    methods: Annotated[
        str | None,
        typer.Option(help=f"Separated by commas: {', '.join(SEGMENTATION_NAMES)}; default all."),
    ] = None,
    margin_s: Annotated[
        float | None, typer.Option(help="Greatest distance of a border found; the thesis' if not.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated data and bootstrap.")] = 0,
    synthetic: Annotated[
        bool, typer.Option("--synthetic", help="The recordings in the folder are simulated.")
    ] = False,
    json_file: Json = None,
    figures: Annotated[
        Path | None,
        typer.Option(help="Folder for figures of the recordings.", callback=target_folder),
    ] = None,
) -> None:
    """Compare segmentation methods (tables 4.1 to 4.4)."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation import segmentation as experiment
    from besman.evaluation.segmentation_tables import segmentation_tables
    from besman.io.atomic_files import write_json

    chosen = None if methods is None else [name.strip() for name in methods.split(",")]
    with stage_display() as display:
        progress, end = display("evaluate")
        result = experiment.evaluate_segmentation(
            data,
            chosen,
            margin_s,
            seed,
            figures,
            "synthetic" if synthetic else "real",
            progress,
        )
        end(True)
    console = open_terminal()
    for table in segmentation_tables(result["rows"]):
        console.print(table)
    if json_file is not None:
        write_json(json_file, result)


@evaluate_app.command("labelling")
def evaluate_labelling(
    data: Annotated[
        Path | None, typer.Option(help="Folder of recordings; default the embedded sample.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Repetitions of what is random.")] = 2,
    json_file: Json = None,
) -> None:
    """Measure how well unnamed trajectories get their names, beside a plain tracker."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation import labelling
    from besman.io.atomic_files import write_json

    with stage_display() as display:
        progress, end = display("evaluate")
        result = labelling.evaluate_labelling(data, seeds, progress)
        end(True)
    open_terminal().print(labelling.labelling_table(result["rows"]))
    if json_file is not None:
        write_json(json_file, result)


@evaluate_app.command("recognition")
def evaluate_recognition(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with segments, or of such folders; if not given, simulated "
            "datasets of the size they have in the thesis."
        ),
    ] = None,
    datasets: Annotated[
        list[str] | None,
        typer.Option("--dataset", help="Simulated dataset, e.g. gestures; all if not given."),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option("--method", help=f"{', '.join(CLASSIFIER_NAMES)}; default all there are."),
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Random choices of examples.")] = 100,
    figures: Figures = None,
    json_file: Json = None,
) -> None:
    """Accuracy over examples, settings and new subjects: figures 5.3 and 5.5 to 5.8."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation.recognition import check_methods, recognition_table, run_recognition
    from besman.evaluation.recognition_data import load_sets, simulate_sets
    from besman.exceptions import ConfigError
    from besman.io.atomic_files import write_json

    chosen = check_methods(methods)
    if data is not None and datasets:
        raise ConfigError("--data and --dataset: got both; expected one of them")
    with stage_display() as display:
        if data is None:
            progress, end = display("simulate")
            sets = simulate_sets(datasets, progress=progress)
            end(True)
        else:
            sets = load_sets(data)
        progress, end = display("recognition")
        result = run_recognition(sets, chosen, draws, progress)
        end(True)
    console = open_terminal()
    console.print(recognition_table(result))
    if json_file is not None:
        write_json(json_file, result)
    if figures is not None:
        from besman.evaluation.recognition_figures import write_recognition_figures

        for path in write_recognition_figures(result, sets, figures):
            console.print(f"wrote {path}", soft_wrap=True)


@evaluate_app.command("prediction")
def evaluate_prediction(
    data: Annotated[
        Path, typer.Option(help="Folder of recordings with segments, one subject or several.")
    ],
    json_file: Json = None,
) -> None:
    """Foresee the next block of new recordings and new subjects, over how much was seen of it."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation import prediction
    from besman.io.atomic_files import write_json

    with stage_display() as display:
        progress, end = display("prediction")
        result = prediction.evaluate_prediction(data, progress)
        end(True)
    console = open_terminal()
    for table in prediction.prediction_tables(result):
        console.print(table)
    console.print(prediction.prediction_note(result), soft_wrap=True)
    if json_file is not None:
        write_json(json_file, result)


@evaluate_app.command("mapping")
def evaluate_mapping(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings with segments, or of such folders: every labelled class; if "
            "not given, simulated stick throws, as many as in the thesis."
        ),
    ] = None,
    robots: Annotated[
        list[str] | None,
        typer.Option("--robot", help="Robot, or a robot.yaml; default ur5, ur10, iiwa7, compi."),
    ] = None,
    subjects: Annotated[int | None, typer.Option(min=1, help="Of simulated throws.")] = None,
    repetitions: Annotated[
        int | None, typer.Option(min=1, help="Simulated throws of each subject.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated throws.")] = 0,
    jobs: Jobs = ALL_CORES,
    figures: Figures = None,
    json_file: Json = None,
) -> None:
    """Demonstrations in the workspaces of several arms, as in section 7.2.3 and figure 7.5."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation import mapping
    from besman.evaluation.mapping_data import choose_sets
    from besman.evaluation.mapping_tables import mapping_tables, reason_lines
    from besman.io.atomic_files import write_json
    from besman.work.work import Work
    from besman.work.workers import Workers

    with stage_display() as display, Workers(jobs) as workers:
        progress, end = display("demos")
        sets = choose_sets(data, subjects, repetitions, seed, progress)
        end(True)
        progress, end = display("mapping")
        work = Work(jobs, progress, workers=workers)
        result, mapped = mapping.evaluate_mapping(sets, robots or mapping.ROBOTS, work=work)
        end(True)
    console = open_terminal()
    for table in mapping_tables(result["rows"]):
        console.print(table)
    for line in reason_lines(result["rows"]):
        console.print(line, soft_wrap=True)
    if json_file is not None:
        write_json(json_file, result)
    if figures is not None:
        from besman.evaluation.mapping_figures import write_mapping_figures

        for path in write_mapping_figures(mapped, figures):
            console.print(f"wrote {path}", soft_wrap=True)


@evaluate_app.command("refinement")
def evaluate_refinement(
    problems: Annotated[
        list[str] | None,
        typer.Option(
            "--problem",
            help=f"{', '.join(FUNCTION_NAMES)}; {', '.join(TASK_RECIPES)}; of whole tasks "
            f"{', '.join(WHOLE_TASK_RECIPES)}; or a pipeline.yaml, whose imitations are refined.",
        ),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            help=f"{', '.join(SEARCH_NAMES)}; {', '.join(CONTEXTUAL_NAMES)}; of whole tasks "
            f"{', '.join(WHOLE_TASK_SEARCHES)}; default all.",
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of every search.")] = 5,
    first_seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 0,
    jobs: Jobs = ALL_CORES,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for learning curves.", callback=target_folder)
    ] = None,
    json_file: Json = None,
) -> None:
    """Compare searches on functions with public figures and on simulated tasks."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation import refinement
    from besman.evaluation.refinement_problems import load_problem, methods_of
    from besman.evaluation.refinement_tables import refinement_tables, write_curves
    from besman.io.atomic_files import write_json
    from besman.work.work import Work
    from besman.work.workers import Workers

    names = problems or refinement.PROBLEMS
    refinement.known_methods(methods, [methods_of(name) for name in names])
    with stage_display() as display, Workers(jobs) as workers:
        chosen = [load_problem(name, display=display, jobs=jobs) for name in names]
        progress, end = display("refinement")
        work = Work(jobs, progress, workers=workers)
        runs = range(first_seed, first_seed + seeds)
        result = refinement.evaluate_refinement(chosen, methods, runs, work)
        end(True)
    console = open_terminal()
    for table in refinement_tables(result["rows"]):
        console.print(table)
    if json_file is not None:
        write_json(json_file, result)
    if figures is not None:
        for path in write_curves(result["rows"], figures):
            console.print(f"wrote {path}", soft_wrap=True)


@evaluate_app.command("hierarchy")
def evaluate_hierarchy(
    datasets: Annotated[
        list[str] | None, typer.Argument(help=f"{', '.join(HIERARCHY_NAMES)}; default all.")
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Draws of examples to learn from.")] = 10,
    json_file: Json = None,
) -> None:
    """Blocks and actions: tables 6.1 and 6.2 and section 8.2, on simulated captures."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.evaluation.hierarchy import EXPERIMENTS, hierarchy_table, run_experiment
    from besman.io.atomic_files import write_json

    rows = []
    with stage_display() as display:
        for name in datasets or EXPERIMENTS:
            progress, end = display(name)
            rows += run_experiment(name, draws=draws, progress=progress)
            end(True)
    if json_file is not None:
        write_json(json_file, {"experiment": "hierarchy", "rows": rows})
    open_terminal().print(hierarchy_table(rows))
