"""Figures as text: what they show, and the same bytes for the same content."""

import re

import numpy as np
import pytest

from besman.records import LabelledRecording, LabelledSegments
from besman.report.figures import COLOURS, label_colours, new_figure, speed_profile, svg, time_line


@pytest.fixture(scope="module")
def recording():
    time = np.arange(200) / 100
    path = np.column_stack([np.sin(3 * time), np.zeros((200, 2))])[:, None]
    return LabelledRecording(time, path, ("hand",), np.zeros((200, 1), bool), 100.0, "a.tsv")


def segments(*rows):
    bounds, labels = np.array([row[:2] for row in rows]), tuple(row[2] for row in rows)
    return LabelledSegments(bounds, labels, np.zeros(len(rows)), 100.0, "a.tsv")


def texts(drawing):
    return re.findall(r"<text[^>]*>([^<]*)</text>", drawing)


def test_a_label_has_the_same_colour_in_every_order():
    assert label_colours(["b", "a", "b"]) == label_colours(("a", "b")) == {
        "a": COLOURS[0], "b": COLOURS[1],
    }  # fmt: skip
    many = label_colours([str(k) for k in range(30)])
    assert set(many.values()) == set(COLOURS)


def test_the_same_figure_is_the_same_text(recording):
    found = segments((0, 100, "out"), (100, 200, "back"))
    colours = label_colours(found.labels)
    one, two = (speed_profile(recording, found, found, "hand", colours) for _ in range(2))
    assert one == two
    assert one.startswith("<svg")
    assert "speed of hand [m/s]" in texts(one)
    assert {"a.tsv", "time [s]"} <= set(texts(one))
    assert any("manual" in text for text in texts(one))
    alone = speed_profile(recording, found, None, "hand", colours)
    assert not any("manual" in text for text in texts(alone))


def test_every_layer_of_a_time_line_has_its_name_and_its_labels():
    blocks = segments((0, 50, "up"), (50, 120, "down"))
    actions = segments((0, 120, "wave"))
    drawing = time_line(
        [("blocks", blocks), ("actions", actions)], label_colours(["up", "down", "wave"]), "a.tsv"
    )
    assert {"blocks", "actions", "up", "down", "wave", "a.tsv"} <= set(texts(drawing))


def test_a_figure_is_as_large_as_it_was_asked_for():
    figure = new_figure(5, 2)
    figure.add_subplot()
    drawing = svg(figure)
    assert 'width="360pt"' in drawing
    assert 'height="144pt"' in drawing
