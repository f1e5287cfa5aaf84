"""Figures of the recognition experiments, like figures 5.3 and 5.5 to 5.8 of the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.classifiers.nearest_neighbour import fit_spread, scale
from besman.evaluation.recognition_data import LabelledSet
from besman.io.atomic_files import make_folder, write_text
from besman.report.figures import COLOURS, new_figure, style, svg

_SHAPES = "osD^vPX*<>"
_MOST_POINTS = 1500


def write_recognition_figures(
    result: dict[str, Any], sets: Sequence[LabelledSet], folder: Path
) -> list[Path]:
    """Draw accuracy over examples, new subjects, settings, and a map of the segments.

    Parameters
    ----------
    result : dict
        What `besman.evaluation.recognition.run_recognition` returned.
    sets : sequence of LabelledSet
        What it worked on.
    folder : Path
        Made if need be.

    Returns
    -------
    list of Path
        The SVG files.
    """
    make_folder(folder)
    paths = []
    for one in sets:
        rows = [row for row in result["rows"] if row["dataset"] == one.name]
        title = f"{one.name} ({one.source})"
        drawings = {
            "examples": _curves([r for r in rows if r["experiment"] == "examples"], title),
            "subjects": _curves(
                [r for r in rows if r["experiment"] == "subjects"], f"{title}, new subject"
            ),
            "settings": _settings([r for r in rows if r["experiment"] == "settings"], title),
            "map": _map(one, title),
        }
        for name, drawing in drawings.items():
            if drawing is not None:
                path = folder / f"{one.name}_{name}.svg"
                write_text(path, drawing, durable=False)
                paths.append(path)
    return paths


def _curves(rows: list[dict[str, Any]], title: str) -> str | None:
    """Accuracy over examples per class, one line for each method."""
    from matplotlib.ticker import MaxNLocator

    if not rows:
        return None
    figure = new_figure(6, 4)
    axes = figure.add_subplot()
    methods = list(dict.fromkeys(row["method"] for row in rows))
    both = any(row["object_features"] for row in rows)
    for method, with_objects in dict.fromkeys((r["method"], r["object_features"]) for r in rows):
        own = [r for r in rows if (r["method"], r["object_features"]) == (method, with_objects)]
        colour = COLOURS[methods.index(method) % len(COLOURS)]
        label = method.replace("_", " ") + (", with object" if with_objects else "")
        _curve(axes, own, colour, label, dashed=both and not with_objects)
    axes.set_ylim(min(60, *axes.get_ylim()), 101)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("examples per class")
    axes.set_ylabel("accuracy [%]")
    crossed = any(row["thesis_accuracy"] is not None for row in rows)
    axes.set_title(f"{title}; crosses: thesis" if crossed else title, fontsize=9)
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    style(axes)
    return svg(figure)


def _curve(axes: Any, rows: list[dict[str, Any]], colour: str, label: str, dashed: bool) -> None:
    """Draw the accuracy of one method, its spread and, if not dashed, crosses for the thesis."""
    x = np.array([row["examples_per_class"] for row in rows])
    y = 100 * np.array([row["accuracy"] for row in rows])
    spread = 100 * np.array([row["accuracy_std"] for row in rows])
    line = "--" if dashed else "-"
    axes.plot(x, y, line, color=colour, marker="o", markersize=3, label=label)
    axes.fill_between(
        x, y - spread, np.minimum(y + spread, 100), color=colour, alpha=0.12, linewidth=0
    )
    thesis = [(row["examples_per_class"], row["thesis_accuracy"]) for row in rows]
    known = [(n, 100 * value) for n, value in thesis if value is not None]
    if known and not dashed:
        at = np.array(known)
        axes.scatter(at[:, 0], at[:, 1], color=colour, marker="x", s=40, zorder=3)


def _settings(rows: list[dict[str, Any]], title: str) -> str | None:
    """Accuracy, training time and prediction time over one parameter of each method."""
    from matplotlib.ticker import NullFormatter

    if not rows:
        return None
    most = any(row["object_features"] for row in rows)
    rows = [row for row in rows if row["object_features"] == most]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    figure = new_figure(max(2.6 * len(methods), 4), 6)
    measures = (("accuracy", "accuracy"), ("train_s", "training [s]"), ("predict_s", "test [s]"))
    # One scale for all methods: their times lie orders of magnitude apart. Whole decades, so that
    # at least two ticks are named.
    limits = {
        key: (
            10 ** np.floor(np.log10(min(row[key] for row in rows))),
            10 ** np.ceil(np.log10(max(row[key] for row in rows))),
        )
        for key in ("train_s", "predict_s")
    }
    for column, method in enumerate(methods):
        own = [row for row in rows if row["method"] == method]
        for line, (key, name) in enumerate(measures):
            axes = figure.add_subplot(3, len(methods), line * len(methods) + column + 1)
            values = np.array([row[key] for row in own])
            axes.plot([row["value"] for row in own], values, "o-", color=COLOURS[column], ms=3)
            if key == "accuracy":
                axes.set_ylim(min(0.6, values.min() - 0.05), 1.01)
                axes.set_title(method.replace("_", " "), fontsize=9)
            else:
                axes.set_yscale("log")
                axes.yaxis.set_minor_formatter(NullFormatter())
                axes.set_ylim(*limits[key])
            if column == 0:
                axes.set_ylabel(name)
            if line == 2:
                axes.set_xlabel(own[0]["setting"])
            style(axes)
    figure.suptitle(f"{title}, {rows[0]['examples_per_class']} examples per class", fontsize=9)
    return svg(figure)


def _map(one: LabelledSet, title: str) -> str | None:
    """Segments in two dimensions by t-SNE: classes by colour, subjects by shape."""
    from sklearn.manifold import TSNE

    rows = np.arange(len(one.labels))
    if len(rows) > _MOST_POINTS:
        rows = np.sort(np.random.default_rng(0).permutation(rows)[:_MOST_POINTS])
    if len(rows) < 10:
        return None
    vectors = scale(one.values[rows], *fit_spread(one.values[rows], one.widths))
    perplexity = min(30.0, (len(rows) - 1) / 3)
    places = TSNE(perplexity=perplexity, init="pca", random_state=0).fit_transform(vectors)
    figure = new_figure(6.5, 5)
    axes = figure.add_subplot()
    subjects = sorted(set(one.subjects.tolist()))
    palette = _class_colours(len(set(one.labels.tolist())))
    for colour, label in zip(palette, sorted(set(one.labels.tolist())), strict=True):
        for shape, subject in enumerate(subjects):
            own = (one.labels[rows] == label) & (one.subjects[rows] == subject)
            axes.scatter(
                places[own, 0],
                places[own, 1],
                color=colour,
                marker=_SHAPES[shape % len(_SHAPES)],
                s=18,
                linewidths=0,
                label=label if shape == 0 else None,
            )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(f"t-SNE, {title}: colour is class, shape is subject", fontsize=9)
    axes.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return svg(figure)


def _class_colours(n: int) -> list[Any]:
    """Return colours for classes, different ones for up to twenty."""
    if n <= len(COLOURS):
        return list(COLOURS[:n])
    from matplotlib import colormaps

    return [colormaps["tab20"](k % 20) for k in range(n)]
