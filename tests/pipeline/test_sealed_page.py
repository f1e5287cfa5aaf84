import pytest

from besman.pipeline.sealed_page import fault_of_page, seal

PAGE = "<html>\n<!-- besman: sha256 " + "0" * 64 + " -->\n</html>\n"
OF, OTHER = "a" * 64, "b" * 64


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "report.html"
    file.write_text(seal(PAGE, OF))
    return file


def test_a_whole_page_of_what_it_should_be_of_has_no_fault(path):
    assert path.read_text().startswith(PAGE)
    assert fault_of_page(path, OF) is None
    assert fault_of_page(path, OTHER) == "shows what the run was before"


def test_a_page_that_is_cut_or_changed_anywhere_has_one(path):
    whole = path.read_bytes()
    for at in range(0, len(whole), 5):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert fault_of_page(path, OF) is not None
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        assert fault_of_page(path, OF) == "is cut or changed"
    path.write_bytes(whole + b"\n")
    assert fault_of_page(path, OF) == "is cut or changed"
