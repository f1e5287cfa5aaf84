"""What the report says in the terminal."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

from besman.report.terminal import _print, outcome_lines


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ([(9, 0), (9, 0)], "marker names: 18 taken from the recordings"),
        ([(0, 9), (0, 9)], "marker names: 18 found among trajectories without names"),
        ([(9, 0), (5, 4)], "marker names: 14 taken from the recordings, 4 found among"),
        ([(0, 0)], "marker names: 0 taken from the recordings"),
    ],
)
def test_where_marker_names_come_from(counts, said):
    names = [{"recording": "a", "taken": taken, "found": found} for taken, found in counts]
    (line,) = outcome_lines({"label": {"names": names}})
    assert line.startswith(said)


@pytest.mark.parametrize("name", ["sim", "a_stage_of_a_long_name"])
def test_no_cell_of_the_stage_table_is_cut(tmp_path, name):
    row = {"name": name, "wall_s": 29.5, "cpu_s": 0.13, "items": 3, "unit": "recordings"}
    row |= {
        "per_item_s": 0.27,
        "cached": False,
        "human": False,
        "peak_rss_mb": 1.0,
        "computed_wall_s": 29.5,
    }
    files = {"timing.json": {"stages": [row], "total_wall_s": 29.5}, "results.json": {}}
    run = SimpleNamespace(state={"name": "a"}, status="done", read=files.get)
    text = io.StringIO()
    _print(run, Console(file=text, width=80))
    assert "machine" in text.getvalue()


def test_of_a_run_from_before_nothing_is_said_of_names():
    assert outcome_lines({"label": {}}) == []


def test_motions_that_are_not_exported_are_named():
    withheld = {f"a_{n}": f"beyond the limit of velocity in {n} of 9 samples" for n in range(1, 6)}
    lines = outcome_lines({"exports": {"n_motions": 7, "withheld": withheld}})
    (line,) = [line for line in lines if line.startswith("warning")]
    assert line.startswith("warning: 5 of 7 not exported: a_1 (beyond the limit of velocity in 1")
    assert line.endswith(" and 2 more")
    assert not outcome_lines({"exports": {"n_motions": 7, "withheld": {}}})


@pytest.mark.parametrize(
    ("shared", "said"),
    [({"episodes_shared": 415}, "26.5 episodes (415 more that all share)"), ({}, "26.5 episodes")],
)
def test_episodes_that_all_motions_share_stand_beside_the_median(shared, said):
    refine = {"n_success": 3, "n_motions": 3, "episodes": {"median": 26.5}, **shared}
    refine |= {"miss_before_m": {"median": 0.15}, "miss_m": {"median": None}}
    (line,) = outcome_lines({"refine": refine})
    assert line == (
        f"refinement: 3 of 3 succeed, miss 15.0 cm before, unknown after (medians), {said}"
    )
