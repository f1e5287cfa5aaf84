"""What `besman play` refuses before it serves anything."""

import re

import pytest
from command_line import besman


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--as", "ros"), "--as: got 'ros'; expected"),
        (("--as", "lsl"), "liblsl listens at all addresses.*expected --to-network"),
        (("--as", "qtm", "--lose", "2"), "--lose 2.*a share from 0 and below 1"),
    ],
)
def test_play_refuses(monkeypatch, capsys, tmp_path, options, message):
    recording = tmp_path / "a.tsv"
    recording.write_text(
        "NO_OF_FRAMES\t3\nNO_OF_MARKERS\t1\nFREQUENCY\t100\nMARKER_NAMES\ta\n"
        + "".join(f"{row}\t0\t0\n" for row in range(3))
    )
    assert besman(monkeypatch, "play", recording, *options) == 2
    assert re.search(message, " ".join(capsys.readouterr().err.split()))
