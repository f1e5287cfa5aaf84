import json

import numpy as np
import pytest
from browser import until

from besman.annotate.named_file import NamedFile
from besman.annotate.naming import GHOST, Naming
from besman.annotate.session import Session
from besman.exceptions import AnnotationError, ChangedError
from besman.io.recordings.formats import read_recording, write_recording
from besman.person.marker_set import load_marker_set
from besman.records import Recording
from besman.stages.label.joined_trajectories import WovenRecording


@pytest.fixture(scope="module")
def named(three_throws):
    return read_recording(three_throws)


def hide(recording, marker, pieces):
    """Make unnamed fragments of a marker: rows (start, end), each a trajectory of its own."""
    column = recording.names.index(marker)
    positions = [np.array(recording.positions[:, k]) for k in range(len(recording.names))]
    names = list(recording.names)
    for start, end in pieces:
        piece = np.full_like(positions[column], np.nan)
        piece[start:end] = recording.positions[start:end, column]
        positions[column][start:end] = np.nan
        positions.append(piece)
        names.append(None)
    return Recording(
        recording.time,
        np.stack(positions, axis=1),
        tuple(names),
        recording.rate_hz,
        recording.source,
        recording.first_frame,
    )


@pytest.fixture(scope="module")
def broken(named):
    return hide(named, "Elbow", [(100, 180), (250, 400)])


@pytest.fixture(scope="module")
def naming(broken):
    return Naming(broken, load_marker_set("right_arm"))


def test_fragments_are_what_has_no_name_and_labelling_knows_them(naming, named):
    assert [(one.start, one.end) for one in naming.fragments] == [(250, 400), (100, 180)]
    assert all(one.best == "elbow" and one.confidence > 0.8 for one in naming.fragments)
    assert naming.note == ""


def test_names_put_the_recording_together_again(naming, named):
    view = naming.view({0: "Elbow", 1: "Elbow"}).recording.whole()
    assert None not in view.names
    assert set(view.names) == set(named.names)
    for name in named.names:
        np.testing.assert_array_equal(
            view.positions[:, view.names.index(name)],
            named.positions[:, named.names.index(name)],
        )


def test_ghosts_are_left_out_and_what_has_no_name_stays(naming):
    view = naming.view({0: GHOST})
    assert view.recording.names[-1] is None
    assert view.columns == {naming.fragments[1].column: len(view.recording.names) - 1}
    elbow = view.recording.gather([view.recording.names.index("Elbow")])
    assert np.isnan(elbow[250:400]).all()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({7: "Elbow"}, "fragment 7: there are 2, counted from 0"),
        ({0: "tail"}, "no marker 'tail'"),
        ({0: "Shoulder"}, "Shoulder is seen already in frames 251 to 400"),
    ],
)
def test_names_that_cannot_be_given_are_refused(naming, names, message):
    with pytest.raises(AnnotationError, match=message):
        naming.view(names)


def test_candidates_begin_with_the_likely_one_and_end_with_those_that_are_seen(naming):
    found = naming.candidates(0, {})
    assert found[0] == ("Elbow", True)
    assert ("Shoulder", False) in found
    free = [is_free for _, is_free in found]
    assert free == sorted(free, reverse=True)
    # A name once given is taken where both would be seen.
    both = hide(naming.base.whole(), "Elbow", [(400, 430)])
    again = Naming(both, load_marker_set("right_arm"))
    assert again.candidates(2, {0: "Elbow"})[0] == ("Elbow", True)
    with pytest.raises(AnnotationError, match="fragment 9: there are 2"):
        naming.candidates(9, {})


def test_recording_without_any_name_is_labelled_first(tmp_path, named):
    positions, names = named.positions, (None,) * len(named.names)
    bare = Recording(named.time, positions, names, named.rate_hz, "bare.tsv", named.first_frame)
    teacher = named
    naming = Naming(bare, load_marker_set("right_arm"), teacher)
    assert set(load_marker_set("right_arm").required) <= set(naming.base.names)


def test_what_labelling_cannot_name_is_listed_with_its_reason(named):
    lonely = Recording(named.time, named.positions[:, :2], (None, None), named.rate_hz, "a.tsv")
    naming = Naming(lonely, load_marker_set("right_arm"))
    assert "does not fit" in naming.note
    assert [one.best for one in naming.fragments] == ["", ""]


def test_take_writes_the_named_recording_and_overwrites_nothing(tmp_path, broken, named):
    path = tmp_path / "a.tsv"
    write_recording(broken, path)
    (tmp_path / "a_named.tsv").write_text("mine")
    take = Session([path]).takes[0]
    take.give_names({0: "Elbow", 1: "Elbow"})
    with pytest.raises(AnnotationError, match="no marker 'x'"):
        take.give_names({0: "x"})
    assert take.names == {0: "Elbow", 1: "Elbow"}
    written = take.write_names()
    assert written.name == "a_named_2.tsv"
    assert (tmp_path / "a_named.tsv").read_text() == "mine"
    again = read_recording(written)
    assert set(again.names) == set(named.names)
    elbow = again.positions[:, again.names.index("Elbow")]
    np.testing.assert_allclose(elbow, named.positions[:, named.names.index("Elbow")], atol=1e-6)
    assert take.write_names() == written
    other = NamedFile(path)
    other.path.write_text("theirs")
    with pytest.raises(AnnotationError, match="was written by another in the meantime"):
        other.write(WovenRecording.of(named))


def test_names_given_in_another_window_are_not_lost(tmp_path, broken):
    path = tmp_path / "a.tsv"
    write_recording(broken, path)
    take = Session([path]).takes[0]
    known = take.about()["naming"]["revision"]
    take.give_names({0: "Elbow"}, known)
    with pytest.raises(ChangedError, match="names were given in another window"):
        take.give_names({1: "Elbow"}, known)
    assert take.names == {0: "Elbow"}
    # To write what is known is no change.
    known = take.about()["naming"]["revision"]
    take.give_names({0: "Elbow"}, known)
    take.give_names({0: "Elbow", 1: "Elbow"}, known)


def test_a_marker_spelt_twice_keeps_both_trajectories(named):
    marker_set = load_marker_set("right_arm")
    (marker, alias, *_), *_ = (
        (key, *aliases) for key, aliases in marker_set.markers.items() if aliases
    )
    names: list[str | None] = [f"other {k}" for k in range(len(named.names))]
    names[:4] = [alias, marker, "other 2", "Other-2"]
    names[-1] = None
    doubled = Recording(
        named.time, named.positions, tuple(names), named.rate_hz, "a.tsv", named.first_frame
    )
    shown = Naming(doubled, marker_set).view({}).recording.whole()
    for column, name in enumerate(names[:-1]):
        np.testing.assert_array_equal(
            shown.positions[:, shown.names.index(name)], named.positions[:, column]
        )


def test_recording_with_all_names_has_nothing_to_name(three_throws, tmp_path):
    path = tmp_path / "a.tsv"
    path.write_bytes(three_throws.read_bytes())
    with pytest.raises(AnnotationError, match="every trajectory has a name"):
        Session([path]).takes[0].give_names({})


def test_fragments_are_named_on_the_page(serve, open_page, tmp_path, broken, named):
    path = tmp_path / "a.tsv"
    write_recording(broken, path)
    page = open_page(serve(path).url, size={"width": 1000, "height": 640})
    page.wait_for_selector("html[data-ready]")
    # By mouse: the dot, then the name.
    page.evaluate("besman.moveTo(300), besman.paint()")
    box = page.locator("#scene").bounding_box()
    unnamed = page.evaluate("besman.about.named.lastIndexOf(false)")
    x, y = page.evaluate("(k) => [...besman.scene.screen.slice(3 * k, 3 * k + 2)]", unnamed)
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_selector("#selected button:has-text('Elbow')")
    assert page.is_disabled("#selected button:has-text('Shoulder')")
    page.click("#selected button:has-text('Elbow')")
    until(page, "besman.naming.selected === 1 && besman.naming.candidates.length")
    # By keyboard: what labelling takes the other for.
    page.keyboard.press("1")
    written = tmp_path / "a_named.tsv"
    until(page, "!besman.naming.dirty")
    assert set(read_recording(written).names) == set(named.names)
    # The elbow was hidden for too long: now there are proposals.
    until(page, "besman.document.of('', 'proposal').length")
    page.keyboard.press("Control+z")
    until(page, "!besman.naming.dirty")
    assert None in read_recording(written).names
    assert json.loads(page.evaluate("JSON.stringify(besman.naming.names)")) == {"0": "Elbow"}
