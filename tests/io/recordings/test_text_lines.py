import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.io.recordings import text_lines
from besman.io.recordings.text_lines import TextLines

TEXTS = st.text(st.sampled_from("a1\t \n\u00e4"), max_size=40)


@given(TEXTS, st.sampled_from(["\n", "\r\n"]), st.sampled_from(["utf-8", "utf-8-sig"]),
       st.integers(1, 9))  # fmt: skip
def test_lines_are_those_of_the_whole_text(text, line_end, encoding, block):
    lines = text.rstrip(" \n").split("\n")
    if encoding == "utf-8-sig" and text.isascii():
        text, lines = text + "\u00e4", (text + "\u00e4").split("\n")
    content = text.replace("\n", line_end).encode(encoding)

    def read(first):
        return [content[k : k + block] for k in range(first, len(content), block)]

    found = TextLines(read)
    assert list(found) == found[:] == lines
    assert len(found) == len(lines)
    assert found[-1] == lines[-1]
    assert found.is_ended == (not text or text.endswith("\n"))
    assert found.is_blank == (not text.strip())
    for count in (1, 2, len(lines), len(lines) + 1):
        assert found.last(count) == lines[-count:]
    for first in range(len(lines) + 2):
        blocks = [found.decode(part) for part in found.blocks(first)]
        assert [line for part in blocks for line in part.split("\n")] == lines[first:]
    found.drop_last()
    assert list(found) == lines[:-1]


def test_what_is_no_utf8_is_latin1():
    assert list(TextLines(lambda first: ["gr\u00fc\u00df\nGott".encode("latin-1")[first:]])) == [
        "gr\u00fc\u00df",
        "Gott",
    ]


def test_a_file_is_read_by_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(text_lines, "_AT_ONCE", 5)
    monkeypatch.setattr(text_lines, "_FIRST", 3)
    path = tmp_path / "a.txt"
    path.write_bytes(b"one\r\ntwo and a half\n\nfour")
    assert list(TextLines.of(path)) == ["one", "two and a half", "", "four"]


def test_the_last_of_many_lines(monkeypatch):
    monkeypatch.setattr(text_lines, "_MOST_BACKWARDS", 2)
    content = "\n".join(map(str, range(9))).encode()
    found = TextLines(lambda first: [content[first:]])
    for count in range(1, 10):
        assert found.last(count) == list(map(str, range(9)))[-count:]


def test_there_is_no_line_beyond_the_last():
    for index in (2, -3, 10):
        with pytest.raises(IndexError, match="no line"):
            TextLines(lambda first: [b"a\nb\n"[first:]])[index]
