import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from besman.exceptions import RunError
from besman.records.files import load_record
from besman.report.page import write_page
from besman.report.terminal import outcome_lines

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


class Page(HTMLParser):
    """Tables, figures, links and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tables, self.figures, self.links = [], [], []
        self.cards, self._in = [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "table":
            self.tables.append({"class": attributes.get("class"), "heads": [], "rows": []})
        elif tag == "tr":
            self.tables[-1]["rows"].append([])
        elif tag in ("td", "th"):
            cell = {"text": "", **attributes}
            table = self.tables[-1]
            (table["heads"] if tag == "th" else table["rows"][-1]).append(cell)
            self._in = cell
        elif tag == "figure":
            self.figures.append("")
        elif tag == "figcaption":
            self._in = {"text": "", "caption": True}
        elif tag == "div" and attributes.get("class") == "card":
            self._in = {"text": ""}
            self.cards.append(self._in)
        self.links += [attributes[name] for name in ("href", "src") if name in attributes]

    def handle_endtag(self, tag):
        if tag == "figcaption":
            if self.figures:
                self.figures[-1] = self._in["text"]
            self._in = None
        elif tag in ("td", "th") or (tag == "div" and self._in in self.cards):
            self._in = None

    def handle_data(self, text):
        if self._in is not None:
            self._in["text"] += text


@pytest.fixture(scope="module")
def page(small_run):
    return Page(write_page(small_run).read_text())


def demonstrations(page):
    (table,) = [one for one in page.tables if one["class"] == "sortable"]
    return table


def test_figures_on_top_are_those_of_the_run(page, small_run):
    results = json.loads((small_run / "results.json").read_text())
    cards = [card["text"] for card in page.cards]
    assert "3 / 3mapped" in cards
    refine = results["refine"]
    assert f"{refine['n_success']} / {refine['n_motions']}within the target" in cards
    assert f"{100 * refine['miss_m']['median']:.1f} cmmedian miss, refined" in cards


def test_every_demonstration_has_a_row_with_its_numbers(page, small_run):
    motions = load_record(next(small_run.glob("*_refine")) / "record.npz")
    mapping = load_record(next(small_run.glob("*_map")) / "record.npz")
    table = demonstrations(page)
    heads = [head["text"] for head in table["heads"]]
    rows = [row for row in table["rows"] if row]
    assert len(rows) == len(motions) == 3
    for row, motion, trajectory in zip(rows, motions, mapping.trajectories, strict=True):
        cells = dict(zip(heads, row, strict=True))
        assert cells["demonstration"]["text"] == motion.plan.name
        assert float(cells["miss, imitated [cm]"]["data-sort"]) == pytest.approx(
            100 * motion.miss_before, abs=0.051
        )
        assert float(cells["miss, refined [cm]"]["data-sort"]) == pytest.approx(
            100 * motion.miss, abs=0.051
        )
        assert cells["episodes"]["text"] == str(motion.simulations.sum())
        assert cells["success"]["text"] == ("yes" if motion.success else "no")
        error = 1000 * trajectory.position_error.mean()
        assert float(cells["position error [mm]"]["text"]) == pytest.approx(error, abs=0.051)
    assert all(head["aria-sort"] == "none" and head["scope"] == "col" for head in table["heads"])


def test_links_lead_to_files_that_are_there(page, small_run):
    local = [link for link in page.links if not link.startswith("data:")]
    assert len([link for link in local if link.endswith(".csv")]) == 6
    for link in local:
        assert (small_run / link).is_file(), link


def test_one_file_without_network(small_run, page):
    text = (small_run / "report.html").read_text()
    assert len(text) < 3_000_000
    assert not [link for link in page.links if re.match(r"(https?:)?//", link)]
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)
    assert text.count("<script>") == 1
    assert "fetch" not in text[text.index("<script>") :]


def test_every_figure_has_a_caption_with_its_unit(page):
    assert len(page.figures) >= 9
    for caption in page.figures:
        assert re.search(r"\[(m|cm|m/s|s|%)\]|return", caption), caption


def test_thesis_stands_beside_and_a_persons_time_apart(page):
    machine, human = page.tables[:2]
    heads = [head["text"] for head in machine["heads"]]
    rows = {row[0]["text"]: row for row in machine["rows"] if row}
    # Table 7.1: 8 throws took 10 minutes of policy search and 4:58 of automatic labelling.
    thesis = heads.index("thesis")
    assert rows["refine"][thesis]["text"] == "3:45 min"
    assert rows["label"][thesis]["text"] == "1:52 min"
    assert rows["transfer to the real arm"][thesis]["text"] == "28:08 min"
    by_hand = {row[0]["text"]: row[2]["text"] for row in human["rows"] if row}
    assert by_hand["labelling movements by hand"] == "50:00 min"
    assert by_hand["naming markers by hand"] == "9:19 min"
    assert not set(by_hand) & set(rows)


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not there")
def test_a_click_on_a_head_sorts_and_another_the_other_way_round(small_run, page, tmp_path):
    column = [head["text"] for head in demonstrations(page)["heads"]].index("miss, imitated [cm]")
    click = f"document.querySelectorAll('table.sortable th button')[{column}].click();"
    # As it was after the first click it stands at the end of the page.
    keep = "document.body.append(document.querySelector('table.sortable').cloneNode(true));"
    text = (small_run / "report.html").read_text()
    changed = tmp_path / "page.html"
    changed.write_text(text.replace("</body>", f"<script>{click}{keep}{click}</script></body>"))
    shown = subprocess.run(
        [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu",
            f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", f"file://{changed}",
        ],
        capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    second, first = (one for one in Page(shown.stdout).tables if one["class"] == "sortable")
    for table, down in ((first, False), (second, True)):
        values = [float(row[column]["data-sort"]) for row in table["rows"] if row]
        assert len(values) == 3
        assert values == sorted(values, reverse=down)
        assert table["heads"][column]["aria-sort"] == ("descending" if down else "ascending")


def test_small_videos_are_inside_and_large_ones_are_links(small_run):
    small, large = small_run / "video.mp4", small_run / "video_subject1.tsv_2.mp4"
    try:
        small.write_bytes(b"small")
        large.write_bytes(b"other")
        text = write_page(small_run).read_text()
        assert 'src="data:video/mp4;base64,c21hbGw="' in text
        assert '<a href="video_subject1.tsv_2.mp4">' in text
    finally:
        small.unlink()
        large.unlink()


def test_no_run(tmp_path):
    with pytest.raises(RunError, match=r"not a run: run\.json is missing"):
        write_page(tmp_path)
    for name in ("run.json", "timing.json", "results.json"):
        (tmp_path / name).write_text("{}")
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        write_page(tmp_path)


def test_both_arms_are_named_in_the_terminal():
    mapped = {
        "n_transferred": 2, "n_demonstrations": 3, "limit_violations": 0, "self_collisions": 0,
        "position_error_m": {"mean": 0.001, "max": 0.002},
    }  # fmt: skip
    lines = outcome_lines({"map": mapped, "map_second": mapped | {"n_transferred": 1}})
    assert lines[0].startswith("mapping: 2 of 3")
    assert lines[1].startswith("second arm, mapping: 1 of 3")
