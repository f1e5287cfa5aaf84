"""Which source an address means: ``file://``, ``lsl:``, ``qtm://``, ``natnet://`` or ``bag:``."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

from besman.exceptions import ConfigError, nearest
from besman.foreign.names import fault_of_characters
from besman.foreign.numbers import parse_number
from besman.io.recordings.format import READING, parse_topics
from besman.live.stream import Source

KNOWN_SOURCES = "file://PATH?pace=1, lsl:NAME, qtm://HOST, natnet://HOST, bag:FOLDER, mcap:PATH"


def find_source(address: str) -> Source:
    """Return the source that an address means; nothing is connected yet.

    Parameters
    ----------
    address : str
        ``file://PATH`` with ``pace`` (1; 0: as fast as can be); ``lsl:NAME`` with ``source_id``
        and ``wait``; ``qtm://HOST[:PORT]`` with ``version`` and ``wait``: seconds of silence after
        which a stream that had begun has ended (10); ``natnet://HOST[:PORT]`` with ``local`` and
        ``wait``; ``bag:PATH``, a folder or file, or ``mcap:PATH``, with ``topic`` (names between
        commas), ``from`` (``now``, ``start``) and ``wait``.

    Raises
    ------
    ConfigError
        If there is no such source, or it has no such option.
    """
    scheme, _, rest = address.partition(":")
    if scheme == "file":
        path, options = _split(address, rest.removeprefix("//"), ("pace",))
        from besman.live.file_source import FileSource

        return FileSource(Path(path), _number(address, options, "pace", 1.0))
    if scheme == "lsl":
        name, options = _split(address, rest.removeprefix("//"), ("source_id", "wait"))
        from besman.live.lsl_source import LslSource

        usual, wait_s = READING.get(), _number(address, options, "wait", 10.0)
        return LslSource(name, options.get("source_id"), usual.units, usual.up, wait_s)
    if scheme == "qtm":
        host, options = _split(address, rest.removeprefix("//"), ("version", "wait"))
        return _find_qtm(address, host, options)
    if scheme == "natnet":
        host, options = _split(address, rest.removeprefix("//"), ("local", "wait"))
        return _find_natnet(address, host, options)
    if scheme in ("bag", "mcap"):
        path, options = _split(address, rest.removeprefix("//"), ("topic", "from", "wait"))
        return _find_bag(address, path, options)
    raise ConfigError(f"--live: got {address!r:.100}; expected one of {KNOWN_SOURCES}")


def _find_bag(address: str, path: str, options: dict[str, str]) -> Source:
    from besman.live.bag_source import BagSource

    usual, begin = READING.get(), options.get("from", "now")
    if begin not in ("now", "start"):
        raise ConfigError(f"--live: {address!r:.100}: from: got {begin!r:.40}; expected now, start")
    topics = parse_topics(options.get("topic")) or usual.topics
    wait_s = _number(address, options, "wait", 10.0)
    return BagSource(Path(path), topics, begin == "start", usual.units, usual.up, wait_s)


def _find_natnet(address: str, host: str, options: dict[str, str]) -> Source:
    from besman.live.natnet_source import PORT, NatNetSource

    name, port = _split_host(address, host, "natnet", PORT)
    wait_s = _number(address, options, "wait", 10.0)
    local = options.get("local", "127.0.0.1")
    return NatNetSource(name, port, local, READING.get().up, wait_s)


def _find_qtm(address: str, host: str, options: dict[str, str]) -> Source:
    from besman.live.qtm_source import PORT, VERSION, QtmSource

    name, port = _split_host(address, host, "qtm", PORT)
    version = options.get("version", VERSION)
    if not re.fullmatch(r"[0-9]{1,3}(\.[0-9]{1,3})?", version):
        raise ConfigError(f"--live: version: got {version!r:.40}; expected a number such as 1.19")
    wait_s = _number(address, options, "wait", 10.0)
    return QtmSource(name, port, version, wait_s)


def _split_host(address: str, host: str, scheme: str, usual: int) -> tuple[str, int]:
    """Return name and port of a host."""
    try:
        parts = urlsplit(f"//{host}")
        port = parts.port or usual
    except ValueError:
        raise ConfigError(f"--live: {address!r:.100}: expected {scheme}://HOST:PORT") from None
    return parts.hostname or "127.0.0.1", port


def _split(address: str, rest: str, allowed: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """Return what is named, and the options behind the question mark."""
    name, _, query = rest.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    for key in options:
        if key not in allowed:
            raise ConfigError(
                f"--live: {address!r:.100}: no option {key!r:.40}; {nearest(key, allowed)}"
            )
    if not name:
        raise ConfigError(f"--live: got {address!r:.100}; expected one of {KNOWN_SOURCES}")
    plain = unquote(name)
    fault = fault_of_characters(plain)
    if fault is not None:
        raise ConfigError(f"--live: {address!r:.100}: the name {fault}")
    return plain, options


def _number(address: str, options: dict[str, str], key: str, usual: float) -> float:
    text = options.get(key, str(usual))
    try:
        value = parse_number(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1e6:
        raise ConfigError(
            f"--live: {address!r:.100}: {key}: got {text!r:.40}; expected a number from 0"
        )
    return value
