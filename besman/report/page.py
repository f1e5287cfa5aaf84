"""``report.html``: one file, no network, readable in light and dark."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.config_file import read_yaml
from besman.exceptions import RunError
from besman.record_files import digest, load_record
from besman.report.confusion import confusion_table
from besman.report.terminal import failures, outcome_lines
from besman.report.timing import read_json, seconds, stage_rows
from besman.run import write_json, write_text
from besman.versions import code_version

# More would take longer to draw than to compute, and nobody looks at hundreds.
_DRAWN_RECORDINGS = 12
_DRAWN_PATHS = 60

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2024; --soft: #62676f; --line: #d9dce1; --page: #fff;
  --card: #f5f6f8; --good: #00734f; --bad: #b3400c }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --soft: #9aa0a8; --line: #363a41;
  --page: #15171a; --card: #1f2226; --good: #3ecf9b; --bad: #ff8a50 } }
* { box-sizing: border-box }
body { margin: 0 auto; padding: 1.5rem; max-width: 72rem; background: var(--page);
  color: var(--ink); font: 15px/1.5 system-ui, sans-serif }
h1 { font-size: 1.5rem; margin: 0 } h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem }
.soft { color: var(--soft) } .good { color: var(--good) } .bad { color: var(--bad) }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1.2rem 0 }
.card { background: var(--card); border-radius: .5rem; padding: .7rem 1rem; min-width: 9rem }
.card b { display: block; font-size: 1.4rem }
.scroll { overflow-x: auto }
table { border-collapse: collapse; width: 100%; font-size: .87rem;
  font-variant-numeric: tabular-nums }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap }
th { color: var(--soft); font-weight: 600 } th:first-child, td:first-child { text-align: left }
figure { margin: 0 } figure svg { width: 100%; height: auto }
figcaption { color: var(--soft); font-size: .85rem }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem }
.key span { display: inline-block; width: .8em; height: .8em; border-radius: .2em; opacity: .6;
  margin: 0 .3em 0 1em }
pre { background: var(--card); padding: .8rem; overflow-x: auto; font-size: .8rem }
@media print { body { max-width: none; padding: 0 } details { display: none } }
"""


def write_page(folder: Path) -> Path:
    """Write ``report.html`` of a run.

    Parameters
    ----------
    folder : Path
        A run folder.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RunError
        If the folder is not a run.
    """
    state = read_json(folder / "run.json")
    timing = read_json(folder / "timing.json")
    results = read_json(folder / "results.json")
    overview, rest = _figures(folder, results)
    body = [
        _head(state, timing, results),
        overview,
        _stage_table(timing, results),
        confusion_table(results),
        rest,
        _provenance(folder, state, results),
    ]
    title = html.escape(f"{state['name']} - besman")
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{_STYLE}</style></head>\n<body>{''.join(body)}</body></html>\n"
    )
    write_text(folder / "report.html", page)
    return folder / "report.html"


def _figures(folder: Path, results: dict[str, Any]) -> tuple[str, str]:
    """Return the overview and all other figures; drawn anew only if a record has changed."""
    descriptions = sorted(folder.glob("[0-9][0-9]_*/stage.json"))
    checksums = [read_json(path).get("sha256") for path in descriptions]
    key = digest((code_version(), tuple(checksums), results))
    kept = folder / "figures.json"
    if kept.is_file() and (drawn := read_json(kept))["key"] == key:
        return drawn["overview"], drawn["rest"]
    records = _records(folder)
    overview = _overview(folder, records)
    rest = "".join(
        draw(records, results) for draw in (_recordings, _actions, _motions, _demonstrations)
    )
    write_json(kept, {"key": key, "overview": overview, "rest": rest})
    return overview, rest


def _records(folder: Path) -> dict[str, Any]:
    """Load the records of the stages that are done."""
    found = {}
    for place in sorted(folder.glob("[0-9][0-9]_*")):
        if (place / "record.npz").is_file():
            found[place.name[3:]] = load_record(place / "record.npz")
    if isinstance(found.get("map"), tuple):
        # Of two arms the first is drawn.
        found["map"] = found["map"][0]
    if (folder / "truth.npz").is_file():
        found["truth"] = load_record(folder / "truth.npz")
    return found


def _head(state: dict[str, Any], timing: dict[str, Any], results: dict[str, Any]) -> str:
    """Name, status and the figures one looks for first."""
    refine, mapped = results.get("refine", {}), results.get("map", {})
    cards = [(seconds(timing["total_wall_s"]), "wall time of this run")]
    computed = sum(row["computed_wall_s"] for row in timing["stages"])
    if any(row["cached"] for row in timing["stages"]):
        cards.append((seconds(computed), "when nothing was cached"))
    if mapped:
        cards.append((f"{mapped['n_transferred']} / {mapped['n_demonstrations']}", "mapped"))
        bad = mapped["limit_violations"] + mapped["self_collisions"]
        cards.append((str(bad), "samples outside a limit or in self-collision"))
    if refine:
        cards.append((f"{refine['n_success']} / {refine['n_motions']}", "within the target"))
        cards.append((_centimetres(refine["miss_before_m"]["median"]), "median miss, imitated"))
        cards.append((_centimetres(refine["miss_m"]["median"]), "median miss, refined"))
    status = state["status"]
    tone = "good" if status == "done" else "bad"
    error = f'<p class="bad">{html.escape(state["error"])}</p>' if state.get("error") else ""
    boxes = "".join(f'<div class="card"><b>{value}</b>{name}</div>' for value, name in cards)
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in outcome_lines(results))
    return (
        f'<h1>{html.escape(state["name"])} <span class="{tone}">{status}</span></h1>{error}'
        f'<div class="cards">{boxes}</div><ul>{lines}</ul>'
    )


def _overview(folder: Path, records: dict[str, Any]) -> str:
    """Draw the demonstration that was refined first; keep the drawing beside the page too."""
    if not records.get("refine"):
        return ""
    from besman.report.overview import overview
    from besman.robot.model import load_robot

    config, _ = read_yaml(folder / "pipeline.yaml")
    motion = records["refine"][0]
    source, _, segment = motion.plan.name.rpartition(":")
    sources = [recording.source for recording in records["label"]]
    at = sources.index(source)
    segments = _selected(records, config["select"], at)
    drawing = overview(
        records["label"][at],
        tuple(segments.bounds[int(segment)]),
        config["select"].get("object"),
        load_robot(config["robot"], config["tool"]),
        motion,
        records["map"].placement,
        config["select"].get("arm", "right"),
    )
    write_text(folder / "overview.svg", drawing)
    return (
        f"<figure>{drawing}<figcaption>{html.escape(motion.plan.name)} from the side: the person's "
        "arm and the robot at instants evenly spread in time, later ones stronger; dotted: the "
        "thrown object.</figcaption></figure>"
    )


def _selected(records: dict[str, Any], select: dict[str, Any], at: int) -> Any:
    """Return the segments that demonstrations of a recording were selected from."""
    if select.get("action") is None:
        return records["recognize"][at]
    levels = records["compose"][at].levels
    return next((one for one in levels if select["action"] in one.labels), levels[0])


def _centimetres(metres: float | None) -> str:
    return "-" if metres is None else f"{100 * metres:.1f} cm"


def _table(header: list[str], rows: list[list[str]]) -> str:
    """Make a table; cells are HTML already."""
    head = "".join(f"<th>{name}</th>" for name in header)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="scroll">{table}</div>'


def _stage_table(timing: dict[str, Any], results: dict[str, Any]) -> str:
    n = results.get("map", {}).get("n_demonstrations", 0)
    rows = [
        [
            row["name"],
            seconds(row["wall_s"]),
            seconds(row["cpu_s"]),
            f"{row['items']} {row['unit']}" if row["items"] else "",
            seconds(row["per_item_s"]) if row["per_item_s"] is not None else "",
            seconds(row["thesis_s"]) if row["thesis_s"] is not None else "",
            "human" if row["human"] else "machine",
            "yes" if row["cached"] else "",
            _memory(row),
        ]
        for row in stage_rows(timing, n)
    ]
    rows.append(["<b>total</b>", f"<b>{seconds(timing['total_wall_s'])}</b>"] + [""] * 7)
    header = ["stage", "wall", "CPU", "items", "per item", "thesis", "by", "cached", "memory [MB]"]
    return (
        "<h2>What every stage cost</h2>"
        + _table(header, rows)
        + '<p class="soft">Per item: of the computation, also where it was cached. Thesis: table '
        f"7.1 (8 throws), scaled to the {n} demonstrations here; its imitation covers select, map "
        "and imitate.</p>"
    )


def _memory(row: dict[str, Any]) -> str:
    """Say the greatest memory of this process so far, and of the greatest of its workers."""
    own, workers = f"{row['peak_rss_mb']:.0f}", row.get("workers", {})
    if not workers.get("n"):
        return own
    return f"{own} + {workers['n']} x {workers['peak_rss_mb']:.0f}"


def _recordings(records: dict[str, Any], results: dict[str, Any]) -> str:
    """Speed, borders and labels of every recording."""
    if "recognize" not in records:
        return ""
    from besman.report import figures

    labelled, found = records["label"], records["recognize"]
    truth = records.get("truth", (None,) * len(found))
    labels = [name for part in (*found, *truth) if part is not None for name in part.labels]
    colours = figures.label_colours(labels)
    key = "".join(
        f'<span style="background:{colour}"></span>{html.escape(name)}'
        for name, colour in colours.items()
    )
    marker = results["segment"]["marker"]
    plots = "".join(
        f"<figure>{figures.speed_profile(recording, segments, manual, marker, colours)}</figure>"
        for recording, segments, manual in _some(
            tuple(zip(labelled, found, truth, strict=True)), _DRAWN_RECORDINGS
        )
    )
    return (
        f'<h2>Segments and their labels</h2><p class="key">{key}</p>{plots}<figcaption>Speed of '
        "the hand, found segments shaded by label, manual segments in the strip below."
        f"{_shown(len(found), _DRAWN_RECORDINGS, 'recordings')}</figcaption>"
    )


def _some(items: Sequence[Any], most: int) -> list[Any]:
    """Return all items, or of more than `most` as many evenly spaced in their order."""
    rows = np.linspace(0, len(items) - 1, min(most, len(items)))
    return [items[row] for row in np.rint(rows).astype(int)]


def _shown(n: int, most: int, what: str) -> str:
    """Say that not all are drawn."""
    return "" if n <= most else f" Drawn are {most} of {n} {what}, evenly spaced in their order."


def _actions(records: dict[str, Any], results: dict[str, Any]) -> str:
    """Show building blocks and what they make, one time line a recording."""
    if "compose" not in records:
        return ""
    from besman.report import figures

    drawn = []
    pairs = tuple(zip(records["recognize"], records["compose"], strict=True))
    for blocks, found in _some(pairs, _DRAWN_RECORDINGS):
        names = [f"actions {k}" if k > 1 else "actions" for k in range(1, len(found.levels) + 1)]
        layers = [("blocks", blocks), *zip(names, found.levels, strict=True)]
        colours = figures.label_colours([name for _, layer in layers for name in layer.labels])
        drawn.append(f"<figure>{figures.time_line(layers, colours, blocks.source)}</figure>")
    return (
        f"<h2>Actions made of building blocks</h2>{''.join(drawn)}<figcaption>Building blocks "
        f"below, the actions they make above.{_shown(len(pairs), _DRAWN_RECORDINGS, 'recordings')}"
        "</figcaption>"
    )


def _motions(records: dict[str, Any], results: dict[str, Any]) -> str:
    """Paths, learning curve and outcomes."""
    if "refine" not in records:
        return ""
    from besman.report import figures

    motions = records["refine"]
    mapped = _some(records["map"].trajectories, _DRAWN_PATHS)
    radius = results["refine"]["success_radius_m"]
    targets = np.array([_target(motion) for motion in motions]).reshape(-1, 3)
    return (
        "<h2>Demonstrated and executed paths</h2>"
        f"<figure>{figures.paths(mapped, _some(motions, _DRAWN_PATHS))}<figcaption>Path of the "
        "tool centre point in the robot's frame (floor below the base)."
        f"{_shown(len(motions), _DRAWN_PATHS, 'motions')}</figcaption></figure>"
        "<h2>Refinement in simulation</h2>"
        f'<div class="pair"><figure>{figures.learning_curve(motions, radius)}<figcaption>Best miss '
        "so far of every motion.</figcaption></figure>"
        f"<figure>{figures.outcome_scatter(motions, targets, radius)}<figcaption>Where each motion "
        "ended, relative to its own target.</figcaption></figure></div>"
    )


def _target(motion: Any) -> np.ndarray:
    """Return what a motion was to reach: the throw's target, else the end pose."""
    thrown = np.all(np.isfinite(motion.plan.target))
    return motion.plan.target if thrown else motion.plan.goal_pose[:3]


def _demonstrations(records: dict[str, Any], results: dict[str, Any]) -> str:
    """One row a demonstration."""
    if "map" not in records:
        return ""
    motions = {motion.plan.name: motion for motion in records.get("refine", ())}
    rows = []
    for trajectory in records["map"].trajectories:
        motion = motions.get(trajectory.name)
        row = [
            html.escape(trajectory.name),
            f"{trajectory.time[-1]:.2f}",
            f"{trajectory.time_stretch:.2f}",
            f"{1000 * trajectory.position_error.mean():.1f}",
            f"{np.rad2deg(trajectory.orientation_error.mean()):.1f}",
        ]
        if motion is not None:
            tone, word = ("good", "yes") if motion.success else ("bad", "no")
            before = _centimetres(motion.miss_before) if np.isfinite(motion.miss_before) else ""
            row += [
                before or html.escape(motion.failure),
                _centimetres(motion.miss),
                str(len(motion.returns)),
                f'<span class="{tone}">{word}</span>',
            ]
        elif motions:
            row += [""] * 4
        rows.append(row)
    header = [
        "demonstration",
        "duration [s]",
        "stretch",
        "position error [mm]",
        "orientation error [deg]",
    ]
    if motions:
        header += ["miss, imitated", "miss, refined", "episodes", "success"]
    return "<h2>Every demonstration</h2>" + _table(header, rows) + _left_out(results)


def _left_out(results: dict[str, Any]) -> str:
    """One row for every demonstration or motion that a stage left out."""
    rows = [
        [html.escape(one["name"]), stage, html.escape(one["reason"])]
        for stage, failed in failures(results).items()
        for one in failed
    ]
    if not rows:
        return ""
    return '<h2 class="bad">Left out</h2>' + _table(["demonstration", "stage", "reason"], rows)


def _provenance(folder: Path, state: dict[str, Any], results: dict[str, Any]) -> str:
    """Config, versions and figures, folded."""
    try:
        config = (folder / "pipeline.yaml").read_text(encoding="utf-8")
    except OSError as error:
        raise RunError(f"{folder}: not a run: pipeline.yaml: {error.strerror}") from None
    parts = {
        "Configuration, every default written": config,
        "Figures of the run": json.dumps(results, indent=2),
        "Versions, machine, inputs": json.dumps(
            {key: state[key] for key in ("versions", "commit", "machine", "inputs")}, indent=2
        ),
    }
    return "<h2>Where it comes from</h2>" + "".join(
        f"<details><summary>{title}</summary><pre>{html.escape(text)}</pre></details>"
        for title, text in parts.items()
    )
