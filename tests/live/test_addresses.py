"""Addresses of sources, and what is said of those that mean none."""

import pytest

from besman.exceptions import ConfigError
from besman.live.addresses import find_source
from besman.live.file_source import FileSource
from besman.live.lsl_source import LslSource
from besman.live.natnet_source import NatNetSource
from besman.live.qtm_source import QtmSource


def test_addresses_mean_sources():
    assert isinstance(find_source("file:///tmp/a.tsv?pace=2"), FileSource)
    assert isinstance(find_source("lsl:mocap?wait=1&source_id=x"), LslSource)
    assert isinstance(find_source("qtm://127.0.0.1:22223?version=1.19"), QtmSource)
    assert isinstance(find_source("natnet://127.0.0.1?local=127.0.0.1"), NatNetSource)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("vicon://host", "got 'vicon://host'; expected one of file://PATH"),
        ("file://", "expected one of file://PATH"),
        ("file://a.tsv?speed=1", "no option 'speed'"),
        ("file://a.tsv?pace=fast", "pace: got 'fast'; expected a number from 0"),
        ("qtm://host:port", "expected qtm://HOST:PORT"),
        ("natnet://host:port", "expected natnet://HOST:PORT"),
        ("qtm://host?version=new", "version: got 'new'; expected a number such as 1.19"),
        ("file://a.tsv?pace=1_0", "pace: got '1_0'; expected a number from 0"),
        ("qtm://host?version=\u0661.\u0661", "expected a number such as 1.19"),
        ("file://a%00b.tsv", "the name has the control character U+0000"),
        ("lsl:x?wait=-1", "wait: got '-1'; expected a number from 0"),
    ],
)
def test_what_means_none_is_one_line(address, said):
    with pytest.raises(ConfigError) as error:
        find_source(address)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
