"""What becomes known of a stream, over Lab Streaming Layer, read by its own client."""

import json
import re
import sys
import uuid

import pytest
from command_line import besman

from besman.cli.live import _Teller
from besman.config.resources import resource_folder
from besman.exceptions import WebError
from besman.live.lsl_events import LslEvents
from besman.live.play_lsl import announce_only_here

pylsl = pytest.importorskip("pylsl", reason="the extra lsl is not installed")
announce_only_here()
SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


def test_lines_arrive_but_for_set_points_and_addresses(capsys):
    # Streams of all programs of this machine are found.
    name = f"besman_{uuid.uuid4().hex}"
    events = LslEvents(name)
    teller = _Teller(keeps=False, events=events)
    inlet = pylsl.StreamInlet(pylsl.resolve_byprop("name", name, 1, 60.0)[0])
    inlet.open_stream(60.0)
    # Who listens may be connected before the other side has taken note of it.
    assert events._outlet.wait_for_consumers(60.0)
    about = inlet.info()
    assert (about.type(), about.channel_count(), about.nominal_srate()) == ("Markers", 1, 0.0)
    block = {"kind": "block", "label": "throw", "uncertainty": float("inf")}
    said = [{"kind": "page", "url": "x"}, {"kind": "joints"}, block, {"kind": "end"}]
    before = pylsl.local_clock()
    for one in said:
        teller.tell(one)
    arrived = [inlet.pull_sample(60.0) for _ in range(2)]
    assert [json.loads(text[0]) for text, _ in arrived] == [
        block | {"uncertainty": None},
        {"kind": "end"},
    ]
    assert all(before <= stamp <= pylsl.local_clock() for _, stamp in arrived)
    assert inlet.pull_sample(0.0)[0] is None
    # All of them are printed.
    assert len(capsys.readouterr().out.splitlines()) == 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("mirror", "--live", f"file://{SAMPLE}", "--robot", "ur5", "--lsl", "x"),
            "--lsl: liblsl listens at all addresses .* expected --to-network",
        ),
        (("follow", SAMPLE, "--lsl", "x"), "--lsl: is of a live stream"),
    ],
)
def test_what_is_not_permitted_is_one_line(monkeypatch, capsys, arguments, message):
    assert besman(monkeypatch, *arguments) == 2
    assert re.search(message, " ".join(capsys.readouterr().err.split()))


def test_without_liblsl_or_a_name_it_says_so(monkeypatch):
    with pytest.raises(WebError, match="--lsl: got an empty name"):
        LslEvents(" ")
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(WebError, match=r"--lsl: .*besman\[lsl\]"):
        LslEvents("x")
