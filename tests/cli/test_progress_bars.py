"""Bars of stages, what is left of them before an error's line, and lines without a terminal."""

import re
import threading

import pytest

from besman.cli.progress_bars import StageLines, stage_display


def test_a_stage_is_told_as_it_begins_and_ends(capsys, monkeypatch):
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    with stage_display() as show:
        progress, end = show("map")
        assert capsys.readouterr().err == "map ...\n"
        progress(0.5)
        end(True)
        assert re.fullmatch(r"map: \d+\.\d s\n", capsys.readouterr().err)
        _, end = show("refine\x1b")
        end(False)
        end(True)
        assert capsys.readouterr().err == "refine\\x1b ...\nrefine\\x1b: not finished\n"


def test_a_long_stage_is_told_of_every_so_often():
    told, often = [], threading.Event()

    def tell(line):
        told.append(line)
        if len(told) == 3:
            often.set()

    stage = StageLines("refine", tell, every_s=0.002)
    stage.progress(0.25)
    assert often.wait(5)
    stage.stop()
    assert told[0] == "refine ..."
    assert told[2] == "refine: 25 %, 0 s"


def test_what_is_never_ended_says_no_more():
    with stage_display() as show:
        progress, _ = show("map")
    assert progress.__self__._over.is_set()


def test_a_bar_that_has_not_begun_is_not_left_before_an_error(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")

    def refuse():
        with stage_display() as display:
            progress, end = display("begun")
            progress(0.5)
            end(False)
            display("refused")
            raise ValueError("what was wrong")

    with pytest.raises(ValueError, match="what was wrong"):
        refuse()
    # What stands there last: the lines before are gone over.
    said = capsys.readouterr().err.rpartition("\x1b[1A")[2]
    assert "begun" in said
    assert "refused" not in said
