import time

from besman.config.stage import Items
from besman.pipeline.clock import Clock
from besman.work.outcome import Notes


def test_a_row_has_the_time_of_this_process_and_of_its_workers():
    clock = Clock()
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass
    notes = Notes()
    notes.cpu_s = 7.0
    notes.workers.update({11: 100.0, 12: 300.0})
    row = clock.row("map", Items(3, "throws"), notes)
    assert row["cpu_s"] >= 7.0 + 0.03
    assert 0.04 < row["wall_s"] <= clock.wall_s
    assert row["computed_wall_s"] == row["wall_s"]
    assert (row["name"], row["items"], row["unit"]) == ("map", 3, "throws")
    assert row["workers"] == {"n": 2, "peak_rss_mb": 300.0}


def test_what_was_loaded_keeps_the_time_that_it_was_computed_in():
    row = Clock().row("map", Items(1), computed=12.5, cached=True)
    assert (row["computed_wall_s"], row["cached"]) == (12.5, True)
    assert row["workers"] == {"n": 0, "peak_rss_mb": None}
