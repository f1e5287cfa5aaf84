"""``report.html``: one file, no network, readable in light and dark, on a phone and on paper."""

from __future__ import annotations

import base64
import html
import json
from pathlib import Path
from typing import Any

from besman.config.yaml_file import read_yaml
from besman.exceptions import RunError
from besman.io.atomic_files import write_json, write_text
from besman.pipeline.derived_files import stale_files
from besman.pipeline.sealed_page import PAGE, seal
from besman.pipeline.stored_run import StoredRun, open_run, read_object
from besman.records.files import digest
from besman.report.centimetres import centimetres
from besman.report.confusion import confusion_table
from besman.report.drawings import Drawings
from besman.report.html_tables import html_table
from besman.report.motions import captioned, demonstration_table, motion_sections, overview_figure
from besman.report.page_style import SORT_SCRIPT, STYLE
from besman.report.recordings import action_section, recording_section
from besman.report.run_records import SHOWN, ArmRecords, arm_records, load_records
from besman.report.stage_tables import stage_tables
from besman.report.task_table import task_table
from besman.report.terminal import failures, outcome_lines
from besman.report.timing import seconds
from besman.report.verification import verification_section
from besman.work.versions import code_version
from besman.work.work import Work

# The page stays one file of less than three megabytes.
_LARGEST_VIDEO = 1_200_000
_ALONE = Work()


def write_page(folder: Path, work: Work = _ALONE) -> Path:
    """Write ``report.html`` of a run.

    Parameters
    ----------
    folder : Path
        A run folder.
    work : Work
        Processes that draw its figures.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RunError
        If the folder is not a run.
    """
    run = open_run(folder)
    with run.reading():
        page = _page(run, work)
    write_text(folder / PAGE, seal(page, run.fingerprint()))
    return folder / PAGE


def _page(run: StoredRun, work: Work) -> str:
    """Put the page together."""
    folder = run.folder
    timing, results = run.read("timing.json"), run.read("results.json")
    config, _ = read_yaml(folder / "pipeline.yaml")
    overview, rest = _figures(run, results, config, work)
    stale = stale_files(run)
    body = [
        _head(run, timing, results, config),
        overview,
        _videos(folder, stale),
        stage_tables(timing, results, config),
        confusion_table(results),
        rest,
        verification_section(run),
        _left_out(results),
        _files(folder, stale),
        _provenance(run, results),
    ]
    title = html.escape(f"{run.state['name']} - besman")
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head>\n<body>{''.join(body)}"
        f"<script>{SORT_SCRIPT}</script></body></html>\n"
    )


def _figures(
    run: StoredRun, results: dict[str, Any], config: dict[str, Any], work: Work
) -> tuple[str, str]:
    """Return the overview and all other figures; drawn anew only if a record has changed."""
    folder = run.folder
    checksums = {name: run.checksum(name) for name in run.stages}
    exports = sorted(path.name for path in folder.glob("exports*/*"))
    key = digest((code_version(), checksums, exports, results))
    kept = folder / "figures.json"
    drawn = _drawn(kept)
    if drawn.get("key") == key:
        return drawn["overview"], drawn["rest"]
    records = load_records(folder, SHOWN)
    arms = arm_records(records, config)
    draw = Drawings()
    shown = [arm for arm in arms if arm.motions]
    overviews = [overview_figure(records, config, arm, draw) for arm in shown]
    rest = recording_section(records, results, draw) + action_section(records, draw)
    rest += task_table(records)
    rest += "".join(motion_sections(arm, results, draw) for arm in arms)
    rest += "".join(demonstration_table(arm, folder) for arm in arms)
    rest, *overviews = draw.fill([rest, *overviews], work)
    pairs = zip(shown, overviews, strict=True)
    overview = "".join(_overview(folder, arm, drawing) for arm, drawing in pairs)
    write_json(kept, {"key": key, "overview": overview, "rest": rest})
    return overview, rest


def _drawn(kept: Path) -> dict[str, str]:
    """Return figures that were drawn before; none where they cannot be read."""
    try:
        drawn = read_object(kept)
    except RunError:
        return {}
    names = ("key", "overview", "rest")
    return drawn if all(isinstance(drawn.get(name), str) for name in names) else {}


def _overview(folder: Path, arm: ArmRecords, drawing: str) -> str:
    """Show an arm's first motion beside the person; keep the drawing beside the page too."""
    write_text(folder / f"overview{arm.suffix}.svg", drawing)
    return captioned(
        drawing,
        f"{html.escape(arm.motions[0].plan.name + arm.heading)} from the side [m]: the person's "
        "arm and the robot at instants evenly spread in time, later ones stronger; dotted: the "
        "path of what is thrown or carried.",
        wide=True,
    )


def _head(
    run: StoredRun, timing: dict[str, Any], results: dict[str, Any], config: dict[str, Any]
) -> str:
    """Name, status and the figures one looks for first."""
    cards = [(seconds(timing["total_wall_s"]), "wall time of this run")]
    if any(row["cached"] for row in timing["stages"]):
        computed = sum(row["computed_wall_s"] for row in timing["stages"])
        cards.append((seconds(computed), "when nothing was cached"))
    two = "map_second" in results
    for suffix, part in (("", config), ("_second", config.get("second_arm") or {})):
        arm = f", {Path(part['robot']).name}" if two else ""
        cards += _arm_cards(results, suffix, arm)
    tone = "good" if run.status == "done" else "bad"
    error = run.state.get("error")
    said = f'<p class="bad">{html.escape(error)}</p>' if error else ""
    boxes = "".join(
        f'<div class="card"><b>{value}</b>{html.escape(name)}</div>' for value, name in cards
    )
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in outcome_lines(results))
    return (
        f'<h1>{html.escape(run.state["name"])} <span class="{tone}">{run.status}</span></h1>{said}'
        f'<div class="cards">{boxes}</div><ul>{lines}</ul>'
    )


def _arm_cards(results: dict[str, Any], suffix: str, arm: str) -> list[tuple[str, str]]:
    """Return what one arm's cards say: figure and name."""
    cards = []
    mapped, refine = results.get(f"map{suffix}"), results.get(f"refine{suffix}")
    if mapped:
        share = f"{mapped['n_transferred']} / {mapped['n_demonstrations']}"
        bad = mapped["limit_violations"] + mapped["self_collisions"]
        cards.append((share, f"mapped{arm}"))
        cards.append((str(bad), f"samples outside a limit or in self-collision{arm}"))
    lost = results.get(f"imitate{suffix}", {}).get("position_error_m", {}).get("max")
    if lost is not None:
        cards.append((f"{1000 * lost:.1f} mm", f"greatest imitation error{arm}"))
    if refine:
        cards.append((f"{refine['n_success']} / {refine['n_motions']}", f"within the target{arm}"))
        for name, word in (("miss_before_m", "imitated"), ("miss_m", "refined")):
            cards.append((centimetres(refine[name]["median"]), f"median miss, {word}{arm}"))
    return cards


def _videos(folder: Path, stale: list[str]) -> str:
    """Show the run's video inside the page if it is small; link the others."""
    shown, links = "", []
    for path in sorted(folder.glob("video*.mp4")):
        if path.name in stale:
            continue
        if path.stem in ("video", "video_second") and path.stat().st_size <= _LARGEST_VIDEO:
            content = base64.b64encode(path.read_bytes()).decode()
            shown += captioned(
                "<video controls muted loop playsinline preload=metadata "
                f'src="data:video/mp4;base64,{content}"></video>',
                "The same motion imitated, on the way and refined, in simulation, at half speed; "
                "the disc or ball is the target, as large as what counts as success. "
                f'(<a href="{path.name}">{path.name}</a>)',
            )
        else:
            links.append(f'<a href="{html.escape(path.name)}">{html.escape(path.name)}</a>')
    if not shown and not links:
        return ""
    more = f"<p>Videos: {' '.join(links)}</p>" if links else ""
    return f'<section class="screen"><h2>Video</h2>{shown}{more}</section>'


def _left_out(results: dict[str, Any]) -> str:
    """One row for every demonstration or motion that a stage left out."""
    rows = [
        [html.escape(one["name"]), stage, html.escape(one["reason"])]
        for stage, failed in failures(results).items()
        for one in failed
    ]
    if not rows:
        return ""
    return '<h2 class="bad">Left out</h2>' + html_table(
        ["demonstration", "stage", "reason"], rows, words=True
    )


def _files(folder: Path, stale: list[str]) -> str:
    """Link what lies beside the page."""
    about = {
        "replay.html": "person and robot in motion, side by side",
        "exports/limits.json": "what each exported motion asks of the arm",
        "exports_second/limits.json": "the same of the second arm",
        "results.json": "every figure of this run",
        "verify.json": "what the motions come to in a second engine",
        "timing.json": "what every stage cost",
        "pipeline.yaml": "the configuration",
        "overview.svg": "the first figure",
    }
    items = "".join(
        f'<li><a href="{name}">{name}</a>: {what}</li>'
        for name, what in about.items()
        if (folder / name).is_file() and name not in stale
    )
    return f"<h2>Files beside this page</h2><ul>{items}</ul>"


def _provenance(run: StoredRun, results: dict[str, Any]) -> str:
    """Config, versions and figures, folded."""
    parts = {
        "Configuration, every default written": (run.folder / "pipeline.yaml").read_text("utf-8"),
        "Figures of the run": json.dumps(results, indent=2),
        "Versions, machine, inputs": json.dumps(
            {key: run.state[key] for key in ("versions", "commit", "machine", "inputs")}, indent=2
        ),
    }
    folded = "".join(
        f"<details><summary>{title}</summary><pre>{html.escape(text)}</pre></details>"
        for title, text in parts.items()
    )
    return f'<section class="screen"><h2>Where it comes from</h2>{folded}</section>'
