"""Figures that are drawn side by side: each in its place, whoever draws it."""

import pytest

from besman.report.drawings import Drawings, draw_now
from besman.work.work import Work
from besman.work.workers import Workers


def square(name: str, size: float) -> str:
    return rf"<svg>{name} \1 {size}</svg>"


def fill(work: Work) -> list[str]:
    draw = Drawings()
    first = [f"<p>{draw(square, name, 2.0)}</p>" for name in "abcdefghijkl"]
    return draw.fill(["".join(first), draw(square, "last", 1.0) + "end", "none"], work)


def test_every_figure_comes_to_its_place():
    first, second, third = fill(Work())
    assert first == "".join(f"<p>{draw_now(square, name, 2.0)}</p>" for name in "abcdefghijkl")
    assert second == draw_now(square, "last", 1.0) + "end"
    assert third == "none"
    # Threads cannot share Matplotlib.
    assert fill(Work(jobs=4)) == [first, second, third]


def test_a_figure_that_fails_says_why():
    draw = Drawings()
    text = draw(square)
    with pytest.raises(TypeError, match="name"):
        draw.fill([text], Work())


def test_workers_draw_the_same():
    draw, words = Drawings(), [f"word {k}" for k in range(5)]
    text = " ".join(draw(str.upper, word) for word in words)
    with Workers(2) as workers:
        assert draw.fill([text], Work(2, workers=workers)) == [text_of(words)]


def text_of(words: list[str]) -> str:
    return " ".join(word.upper() for word in words)
