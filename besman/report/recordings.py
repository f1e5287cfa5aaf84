"""The report's sections on the recordings: segments, labels, actions."""

from __future__ import annotations

import html
from typing import Any

from besman.report.drawings import DrawFigure, draw_now
from besman.report.motions import captioned, evenly

_DRAWN = 12


def recording_section(
    records: dict[str, Any], results: dict[str, Any], draw: DrawFigure = draw_now
) -> str:
    """Draw speed, borders and labels of every recording; "" before recognition."""
    if "recognize" not in records:
        return ""
    from besman.report import figures

    labelled, found = records["label"], records["recognize"]
    truth = records.get("truth", (None,) * len(found))
    labels = [name for part in (*found, *truth) if part is not None for name in part.labels]
    colours = figures.label_colours(labels)
    marker = results["segment"]["marker"]
    drawn = "".join(
        captioned(
            draw(figures.speed_profile, recording, segments, manual, marker, colours),
            f"{html.escape(recording.source)}: speed of {html.escape(marker)} [m/s] over time "
            "[s], found segments shaded by label"
            + (", manual segments in the strip below." if manual is not None else "."),
            wide=True,
        )
        for recording, segments, manual in evenly(
            tuple(zip(labelled, found, truth, strict=True)), _DRAWN
        )
    )
    return (
        f"<h2>Segments and their labels</h2>{_key(colours)}{drawn}"
        f"{_not_all(len(found), 'recordings')}"
    )


def action_section(records: dict[str, Any], draw: DrawFigure = draw_now) -> str:
    """Draw building blocks and what they make, one time line a recording; "" without actions."""
    if "compose" not in records:
        return ""
    from besman.report import figures

    drawn = []
    pairs = tuple(zip(records["recognize"], records["compose"], strict=True))
    for blocks, found in evenly(pairs, _DRAWN):
        names = [f"actions {k}" if k > 1 else "actions" for k in range(1, len(found.levels) + 1)]
        layers = [("blocks", blocks), *zip(names, found.levels, strict=True)]
        colours = figures.label_colours([name for _, layer in layers for name in layer.labels])
        caption = (
            f"{html.escape(blocks.source)}: building blocks below, the actions they make above, "
            "over time [s]."
        )
        line = draw(figures.time_line, layers, colours, blocks.source)
        drawn.append(captioned(line, caption, True))
    return (
        f"<h2>Actions made of building blocks</h2>{''.join(drawn)}"
        f"{_not_all(len(pairs), 'recordings')}"
    )


def _key(colours: dict[str, str]) -> str:
    """Say which colour is which label."""
    names = "".join(
        f'<span style="background:{colour}"></span>{html.escape(name)}'
        for name, colour in colours.items()
    )
    return f'<p class="key">{names}</p>'


def _not_all(n: int, what: str) -> str:
    if n <= _DRAWN:
        return ""
    return f'<p class="soft">Drawn are {_DRAWN} of {n} {what}, evenly spaced in their order.</p>'
