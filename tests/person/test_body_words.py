import pytest

from besman.person.body_words import guess_part


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("RSHO", ("shoulder", "right")),
        ("Ann:LELB", ("elbow", "left")),
        ("RWRA", ("wrist_thumb_side", "right")),
        ("LWRB", ("wrist_little_side", "left")),
        ("RFIN", ("knuckle", "right")),
        ("RAC", ("shoulder", "right")),
        ("LRAD", ("wrist_thumb_side", "left")),
        ("RULN", ("wrist_little_side", "right")),
        ("RHAND", ("knuckle", "right")),
        ("left_wrist", ("wrist", "left")),
        ("Right Elbow", ("elbow", "right")),
        ("R.Acromium", ("shoulder", "right")),
        ("RKNE", ("", "right")),
        ("STRN", ("", "")),
        ("box_back", ("", "")),
    ],
)
def test_parts_and_sides(name, expected):
    assert guess_part(name) == expected
