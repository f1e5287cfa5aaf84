"""Run a command of besman within the tests' process."""

import pytest

from besman.cli import main as cli


def besman(monkeypatch, *arguments):
    """Run a command; return its exit code."""
    monkeypatch.setattr("sys.argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return caught.value.code or 0
