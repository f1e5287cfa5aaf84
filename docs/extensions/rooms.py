"""Directive ``rooms``: the folders of a package and what they import, as a picture.

Every room stands one floor above the highest that it imports. An arrow that follows from others
is left out: what a room sees through rooms below it.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

Imports = Mapping[str, set[str]]

WIDTH, ROW, BOX = 960, 74, 24
_LETTER, _ROOM = 7.4, 18


def read_rooms(package: Path) -> dict[str, set[str]]:
    """Return the rooms of a package and which others each imports, lazy and typing imports too."""
    rooms: dict[str, set[str]] = {}
    for path in sorted(package.rglob("*.py")):
        room = path.relative_to(package).parts[0].removesuffix(".py")
        if room.startswith("__"):
            continue
        known = rooms.setdefault(room, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{one.name}" for one in node.names]
            parts = [name.split(".") for name in names]
            known |= {part[1] for part in parts if part[0] == package.name and len(part) > 1}
    return {room: (known & rooms.keys()) - {room} for room, known in rooms.items()}


def floors_of(rooms: Imports) -> list[list[str]]:
    """Return the rooms of each floor, from the ground up.

    Raises
    ------
    ValueError
        If some import each other in a circle, so that none of them is above the others.
    """
    floors: list[list[str]] = []
    placed: set[str] = set()
    while placed != rooms.keys():
        floor = [room for room in rooms if room not in placed and rooms[room] <= placed]
        if not floor:
            raise ValueError(f"rooms import each other: {', '.join(sorted(rooms.keys() - placed))}")
        floors.append(floor)
        placed |= set(floor)
    return floors


def arrows_of(rooms: Imports) -> list[tuple[str, str]]:
    """Return who imports whom, without what follows from others."""
    seen: dict[str, set[str]] = {}
    for room in (one for floor in floors_of(rooms) for one in floor):
        seen[room] = rooms[room].union(*(seen[other] for other in rooms[room]))
    return [
        (room, other)
        for room, others in rooms.items()
        for other in sorted(others)
        if not any(other in seen[between] for between in others)
    ]


def place_rooms(rooms: Imports) -> dict[str, tuple[float, float, float]]:
    """Return middle, top and width of every room's box, each near those that import it."""
    arrows, floors = arrows_of(rooms), floors_of(rooms)
    boxes: dict[str, tuple[float, float, float]] = {}
    for row, floor in enumerate(reversed(floors)):
        above = {room: [boxes[one][0] for one, other in arrows if other == room] for room in floor}
        middle = {room: sum(x) / len(x) if x else WIDTH / 2 for room, x in above.items()}
        order = sorted(floor, key=lambda room: (middle[room], room))
        widths = [_LETTER * len(room) + _ROOM for room in order]
        gap = min((WIDTH - sum(widths)) / (len(order) + 1), 60.0)
        x = (WIDTH - sum(widths) - gap * (len(order) - 1)) / 2
        for room, width in zip(order, widths, strict=True):
            boxes[room] = (x + width / 2, 4.0 + row * ROW, width)
            x += width + gap
    return boxes


def draw_rooms(rooms: Imports) -> str:
    """Return the picture as an SVG that takes the page's colours."""
    boxes = place_rooms(rooms)
    height = max(y for _, y, _ in boxes.values()) + BOX + 4
    lines = [
        f'<svg class="rooms" viewBox="0 0 {WIDTH} {height:.0f}" role="img" '
        'aria-label="which folder imports which" xmlns="http://www.w3.org/2000/svg">'
    ]
    for room, other in arrows_of(rooms):
        (x, y, _), (to, end, _) = boxes[room], boxes[other]
        y += BOX
        path = f"M{x:.0f} {y:.0f} C{x:.0f} {y + 30:.0f} {to:.0f} {end - 30:.0f} {to:.0f} {end:.0f}"
        lines.append(f'<path d="{path}"/>')
    for room, (x, y, width) in boxes.items():
        lines.append(
            f'<rect x="{x - width / 2:.0f}" y="{y:.0f}" width="{width:.0f}" height="{BOX}" rx="4"/>'
            f'<text x="{x:.0f}" y="{y + 16:.0f}">{escape(room)}</text>'
        )
    return "\n".join([*lines, "</svg>"])


class Rooms(SphinxDirective):
    """Show the rooms of a package."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Draw what the imports say today."""
        package = Path(str(import_module(self.arguments[0]).__file__)).parent
        for path in package.rglob("*.py"):
            self.env.note_dependency(str(path))
        return [nodes.raw("", draw_rooms(read_rooms(package)), format="html")]


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("rooms", Rooms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
