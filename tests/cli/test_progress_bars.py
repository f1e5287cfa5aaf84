"""Bars of stages, and what is left of them before an error's line."""

import pytest

from besman.cli.progress_bars import stage_display


def test_a_bar_that_has_not_begun_is_not_left_before_an_error(capsys):
    def refuse():
        with stage_display() as display:
            progress, end = display("begun")
            progress(0.5)
            end(False)
            display("refused")
            raise ValueError("what was wrong")

    with pytest.raises(ValueError, match="what was wrong"):
        refuse()
    said = capsys.readouterr().err
    assert "begun" in said
    assert "refused" not in said
