"""Templates in a run folder, and the motions that they give as files for the arm."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.settings import parse_setting
from besman.config.stage import Work
from besman.config.yaml_file import parse_config
from besman.exceptions import RefinementError, RunError
from besman.foreign.json_text import parse_json
from besman.io.atomic_files import make_folder, write_json, write_record
from besman.io.exports import ros_joint_trajectory, write_joint_csv, write_ros_joint_trajectory
from besman.io.urscript import UR_JOINTS, write_urscript
from besman.pipeline.finished_run import read_run
from besman.pipeline.stored_run import open_run, read_object
from besman.records.files import digest, load_record
from besman.search.kinds import usual_spelling
from besman.templates.applying import Application
from besman.templates.learning import TemplateConfig, Tries
from besman.templates.teaching import Region, prepare_lesson, teach
from besman.templates.template import Template
from besman.work.stopping import last_words
from besman.work.versions import code_version

ENDINGS = (".csv", ".json", ".yaml", ".script")


def parse_settings(given: dict[str, Any], settings: tuple[str, ...] = ()) -> TemplateConfig:
    """Make the config of a template.

    Parameters
    ----------
    given : dict
        Its fields.
    settings : tuple of str
        ``KEY=VALUE`` of further ones, values in YAML.

    Raises
    ------
    ConfigError
        If a field is unknown or its value not allowed.
    """
    content = dict(given)
    for setting in settings:
        key, value = parse_setting(setting, "population=25")
        content[key] = value
    return parse_config(content, TemplateConfig, "template")


def learn_in_run(
    folder: Path,
    names: tuple[str, ...],
    region: Region,
    config: TemplateConfig,
    work: Work = Work(),
) -> tuple[Template, Path]:
    """Learn a template and store it in the run; the same one is loaded, a stopped one goes on.

    Parameters
    ----------
    folder : Path
        The run.
    names, region
        As in `besman.templates.teaching.prepare_lesson`.
    config : TemplateConfig
    work : Work
        Threads and progress.

    Returns
    -------
    template : Template
    path : Path
        ``RUN/templates/METHOD.npz``; beside it is a JSON file with its figures.
    """
    run = read_run(folder)
    lesson = prepare_lesson(run.motions, run.robot, run.task, names, region, config)
    parts = (config, lesson.family, lesson.region, run.robot.content, run.task, code_version())
    key = digest(parts)
    path = folder / "templates" / f"{config.method}.npz"
    make_folder(path.parent)
    if _key(path) == key:
        return load_record(path), path
    part = path.with_name(f".{config.method}.part.npz")
    known = _episodes(part, key)
    with last_words(lambda why: None):
        template = teach(lesson, config, run.labels, work, known, partial(_keep, part, key))
    # The figures name the key and come last: with them the template is whole.
    path.with_suffix(".json").unlink(missing_ok=True)
    write_record(path, template)
    content = {
        "key": key,
        "motions": open_run(folder, needs_state=False).checksum("refine"),
        "config": config.model_dump(mode="json"),
        **template_figures(template),
    }
    write_json(path.with_suffix(".json"), content)
    part.unlink(missing_ok=True)
    return template, path


def template_figures(template: Template) -> dict[str, Any]:
    """Return the figures of a template: context, region, and what its last episodes gave."""
    checks = template.checks
    landed = checks.misses[np.isfinite(checks.misses)]
    return {
        "robot": template.robot,
        "tool": template.tool,
        "task": template.task,
        "base": template.family.base.name,
        "region": {
            name: ends.tolist()
            for name, ends in zip(template.family.names, template.region.T, strict=True)
        },
        "episodes": len(template.tries.rewards),
        "checks": len(checks.rewards),
        "success_share": float(checks.successes.mean()),
        "failed_share": 1.0 - len(landed) / len(checks.misses),
        "reward": float(checks.rewards.mean()),
        "miss_m": {
            "median": float(np.median(landed)) if len(landed) else None,
            "max": float(landed.max()) if len(landed) else None,
        },
    }


def load_template(folder: Path, method: str | None = None) -> Template:
    """Load a template of a run.

    Parameters
    ----------
    folder : Path
        The run.
    method : str, optional
        By which it was learnt; needed if there are several.

    Raises
    ------
    RunError
        If there is none, it is not clear which, or it is of motions that the run no longer holds.
    """
    places: dict[str, Path] = {}
    for path in sorted((folder / "templates").glob("[!.]*.npz")):
        name = usual_spelling(path.stem)
        # One learnt since the method bears its present name stands for an older one.
        if path.with_suffix(".json").is_file() and (name == path.stem or name not in places):
            places[name] = path
    there = ", ".join(places) or "none"
    method = None if method is None else usual_spelling(method)
    if method is None and len(places) > 1:
        raise RunError(f"{folder}: several templates: {there}; say which with --method")
    if not places or (method is not None and method not in places):
        raise RunError(
            f"{folder}: no template{f' {method}' if method else ''} here (there: {there}); "
            f"expected one from besman template learn {folder}"
        )
    path = places[method] if method else next(iter(places.values()))
    _refuse_stale(folder, path)
    template: Template = load_record(path)
    return template


def _refuse_stale(folder: Path, path: Path) -> None:
    """Refuse a template of motions that the run held once."""
    of = read_object(path.with_suffix(".json")).get("motions")
    if of is not None and of != open_run(folder, needs_state=False).checksum("refine"):
        raise RunError(
            f"{path}: was learnt of other motions than the run holds now; learn it again: besman "
            f"template learn {folder}"
        )


def write_application(applied: Application, paths: list[Path]) -> None:
    """Write a motion in the formats that the endings of paths say.

    ``.csv`` is a table, ``.json`` and ``.yaml`` are ROS 2 JointTrajectory messages, ``.script`` is
    URScript.

    Raises
    ------
    RefinementError
        If an ending is none of these, or URScript is asked for of another arm.
    RunError
        If a file exists, or its folder does not.
    """
    names = applied.plan.joint_names
    for path in paths:
        allowed = ENDINGS if names == UR_JOINTS else ENDINGS[:-1]
        if path.suffix not in allowed:
            raise RefinementError(
                f"--out: got {path}, expected a file that ends in {', '.join(allowed)}"
            )
        if path.exists():
            raise RunError(f"--out: {path} exists; give a new name")
        if not path.parent.is_dir():
            raise RunError(f"--out: {path}: there is no folder {path.parent}")
    movement = applied.positions, applied.velocities, applied.accelerations
    for path in paths:
        if path.suffix == ".csv":
            write_joint_csv(path, applied.time, *movement, names)
        elif path.suffix == ".script":
            write_urscript(path, applied.plan.name, applied.time, applied.positions)
        else:
            message = ros_joint_trajectory(applied.time, *movement, names)
            write_ros_joint_trajectory(path, message)


def describe_application(applied: Application) -> dict[str, Any]:
    """Return what is known about an application, for JSON."""
    return {
        "name": applied.plan.name,
        "duration_s": float(applied.time[-1]),
        "forecast": asdict(applied.forecast),
        "limits": asdict(applied.limits),
        "warnings": list(applied.warnings),
        "wall_s": applied.wall_s,
    }


def _key(path: Path) -> str | None:
    """Return the key of a whole template."""
    try:
        content = parse_json(path.with_suffix(".json").read_bytes())
    except (OSError, ValueError):
        return None
    key = content.get("key") if isinstance(content, dict) else None
    return str(key) if path.is_file() else None


def _episodes(part: Path, key: str) -> Tries | None:
    """Return the episodes of a search that was stopped, if it was the same."""
    try:
        of, tries = load_record(part)
    except (RunError, TypeError, ValueError):
        return None
    return tries if of == key and isinstance(tries, Tries) else None


def _keep(part: Path, key: str, tries: Tries) -> None:
    """Store the episodes so far."""
    write_record(part, (key, tries))
