from typing import Annotated, Literal

import pytest
from pydantic import Field

from besman.config.stage import Config
from besman.config.yaml_file import load_config, read_yaml
from besman.exceptions import ConfigError


class Vmci(Config):
    method: Literal["vmci"] = "vmci"
    rate_hz: float = Field(20.0, gt=0)


class Locmin(Config):
    method: Literal["locmin"] = "locmin"
    window_s: float = 0.2


class Pipeline(Config):
    name: str
    segment: Annotated[Vmci | Locmin, Field(discriminator="method")] = Vmci()
    tools: dict[str, Vmci] = Field(default_factory=dict)


@pytest.fixture
def load(tmp_path):
    def load_text(text):
        (tmp_path / "p.yaml").write_text(text)
        return load_config(tmp_path / "p.yaml", Pipeline)

    return load_text


def test_a_good_file(load):
    config = load("name: a\nsegment:\n  method: vmci\n  rate_hz: 30\n")
    assert config.segment.rate_hz == 30


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nam: a\n", r"p\.yaml:1: unknown key 'nam'; did you mean 'name'\?"),
        (
            "name: a\nsegment:\n  method: vmci\n  rat_hz: 3\n",
            r"p\.yaml:4: unknown key 'segment\.rat_hz'; did you mean 'rate_hz'\? "
            r"allowed: method, rate_hz$",
        ),
        ("name: a\nname: b\n", r"p\.yaml:2: key 'name' is there twice, first in line 1"),
        ("segment: {method: vmci}\n", r"p\.yaml: key 'name' is missing"),
        (
            "name: a\nsegment: {method: vmcj}\n",
            r"p\.yaml:2: segment\.method: got 'vmcj'; did you mean 'vmci'\? allowed: locmin, vmci",
        ),
        (
            "name: a\nsegment:\n  method: vmci\n  rate_hz: -1\n",
            r"p\.yaml:4: segment\.rate_hz: got -1; input should be greater than 0",
        ),
        ("name: [\n", r"p\.yaml:2: not valid YAML"),
        ("- a\n", r"p\.yaml:1: expected a mapping"),
        ("", r"p\.yaml:1: expected a mapping"),
        ("name: !!python/object/apply:os.system [ls]\n", r"p\.yaml:1: not valid YAML"),
        ("name: \x01\n", r"p\.yaml: not valid YAML"),
        ("name: a\ntools:\n  x:\n    rte_hz: 1\n", r"p\.yaml:4: unknown key 'tools\.x\.rte_hz'"),
    ],
)
def test_errors_say_where_and_what(load, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load(text)
    assert "\n" not in str(caught.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(ConfigError, match="no such file"):
        read_yaml(tmp_path / "nothing.yaml")
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read as text"):
        read_yaml(tmp_path / "b.yaml")
