"""HTTP clients for vendors' packages: whom they ask, and how much they read.

Imports the HTTP library, so it is imported with the first question.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import httpx2

from tdac_agent.models.bounds import (
    ERROR_BYTES,
    EVENT_BYTES,
    EVENT_LINES,
    STREAM_BYTES,
)
from tdac_agent.models.provider import ProviderFault
from tdac_agent.storage.secrets import is_loopback, one_line

BLANK_LINES = (b"\n\n", b"\r\n\r\n", b"\r\r")


def client_options(base_url: str | None) -> dict[str, Any]:
    """Returns options of an HTTP client for a model's server.

    Args:
        base_url: URL of the server; None for the vendor's own.
    """
    return {
        # A redirect could send prompt and key elsewhere.
        "follow_redirects": False,
        # What is compressed could be far larger than what is received.
        "headers": {"accept-encoding": "identity"},
        "event_hooks": {"response": [_bound]},
        **_without_proxy(base_url),
    }


def _without_proxy(base_url: str | None) -> dict[str, Any]:
    """Options that keep questions to this machine away from proxies.

    A proxy would see the key, and could answer.
    """
    if base_url is None or not is_loopback(base_url):
        return {}
    parts = urlsplit(base_url)
    if parts.scheme == "http":
        return {"trust_env": False}
    # Here the environment may name certificates.
    host = f"[{parts.hostname}]" if ":" in str(parts.hostname) else parts.hostname
    return {"mounts": {f"all://{host}": None}}


def _bound(response: httpx2.Response) -> None:
    """Limits how much is read of a response."""
    encoding = response.headers.get("content-encoding", "identity").strip().lower()
    stream = response.stream
    if not isinstance(stream, httpx2.SyncByteStream):
        raise TypeError("the client is not synchronous")
    compressed = "" if encoding in {"", "identity"} else one_line(encoding, 40)
    kind = _ErrorBody if response.status_code >= 400 else _Answer
    response.stream = kind(stream, compressed)


class _Bounded(httpx2.SyncByteStream):
    """The body of a response.

    Args:
        stream: Its pieces.
        compressed: Name of its compression; empty for none.
    """

    def __init__(self, stream: httpx2.SyncByteStream, compressed: str) -> None:
        self._stream = stream
        self._compressed = compressed

    def close(self) -> None:
        self._stream.close()


class _ErrorBody(_Bounded):
    """Ends early; a compressed one is empty."""

    def __iter__(self) -> Iterator[bytes]:
        left = 0 if self._compressed else ERROR_BYTES
        for piece in self._stream if left else ():
            yield piece[:left]
            left -= len(piece)
            if left <= 0:
                return


class _Answer(_Bounded):
    """Raises ProviderFault if it or one of its events is too large, or compressed."""

    def __iter__(self) -> Iterator[bytes]:
        if self._compressed:
            raise ProviderFault(
                f"the server compresses its answer ({self._compressed}), although it "
                "was asked not to"
            )
        total = size = lines = 0
        before = b""
        for piece in self._stream:
            total += len(piece)
            # A blank line ends an event, and may be split between pieces.
            joint = before + piece
            end = max(joint.rfind(blank) for blank in BLANK_LINES)
            if end >= 0:
                size = lines = 0
            size += len(joint) - max(end, len(before))
            lines += joint.count(b"\n", max(end, len(before)))
            before = joint[-3:]
            _check(total, size, lines)
            yield piece


def _check(total: int, size: int, lines: int) -> None:
    """Raises ProviderFault unless the size of an answer is usual."""
    if total > STREAM_BYTES:
        raise ProviderFault(f"the answer has more than {STREAM_BYTES / 1e6:g} MB")
    if size > EVENT_BYTES:
        limit = f"{EVENT_BYTES / 1e6:g} MB"
        raise ProviderFault(f"a piece of the answer has more than {limit}")
    if lines > EVENT_LINES:
        raise ProviderFault(f"a piece of the answer has more than {EVENT_LINES} lines")
