"""What a hostile or careless server answers, through the vendors' packages.

Each attack is a function of the vendor that returns what the fault server plays, the
kind of the fault, and what its message says.
"""

import gzip
import json
from dataclasses import dataclass
from functools import cache
from typing import Any

from fault_server import ANTHROPIC, begins, events, raw

DEEP = 100_000
MEGABYTE = b"a" * 1_000_000
ENDLESS_MB = 400
HUGE = 2**63


@dataclass(frozen=True)
class Attack:
    play: Any
    fault: str
    told: str


def pour(line, start, piece, most=ENDLESS_MB):
    """Sends a piece again and again, until the client has had enough."""
    try:
        line.send(start)
        for _ in range(most):
            line.handler.wfile.write(piece)
    except OSError:
        pass


def endless(start, piece, status=200, content="text/event-stream", **headers):
    def play(line):
        line.start(status, content, **headers)
        pour(line, start, piece)

    return lambda vendor: play


@cache
def packed():
    """Two hundred megabytes as two hundred kilobytes."""
    return gzip.compress(b'{"error": "' + b"0" * 200_000_000 + b'"}')


def bomb(status):
    """An answer that is `packed`."""

    def attack(vendor):
        content = packed()

        def play(line):
            line.start(
                status,
                "application/json" if status >= 400 else "text/event-stream",
                content_encoding="gzip",
                content_length=str(len(content)),
            )
            pour(line, "", content, most=1)

        return play

    return attack


def reports(tokens):
    """A whole answer that reports this many tokens, as JSON."""

    def attack(vendor):
        text = "".join(events(vendor)).replace(
            '"output_tokens": 5', f'"output_tokens": {tokens}'
        )
        return raw(
            text.replace('"completion_tokens": 5', f'"completion_tokens": {tokens}')
        )

    return attack


def nested(vendor):
    """An event in the middle of an answer that is nested deeply."""
    name = "event: content_block_delta\n" if vendor == ANTHROPIC else ""
    text = f"{name}data: {'[' * DEEP}{']' * DEEP}\n\n"
    return begins(vendor, lambda line: line.send(text))


def nested_error(status, key):
    """An error whose description is nested deeply, at one of its keys."""
    deep = "[" * 900 + "]" * 900
    body = f'{{"error": {{"type": "a", "{key}": {deep}}}}}'
    return lambda vendor: raw(body, "application/json", status)


def numbered_error(vendor):
    """An error whose code is a number of four thousand digits."""
    return raw(f'{{"error": {{"code": {"9" * 4000}}}}}', "application/json", 400)


def long_text(vendor):
    """Three million characters, in pieces."""
    pieces = events(vendor, "x" * 2)
    at = next(n for n, piece in enumerate(pieces) if '"xx"' in piece)
    piece = pieces[at].replace('"xx"', json.dumps("x" * 30_000))
    return begins(vendor, lambda line: pour(line, "", piece.encode(), 100), "xx", at)


LINES = b"data: a\n" * 100_000
ATTACKS = {
    "2^63 tokens": Attack(reports(HUGE), "transient", "more than 1000000000 tokens"),
    "4000 digits of tokens": Attack(reports("9" * 4000), "transient", "1000000000 tok"),
    "deep JSON": Attack(nested, "transient", "malformed answer"),
    "a deep error": Attack(nested_error(400, "message"), "permanent", "^400: a"),
    "a deep code": Attack(nested_error(503, "code"), "transient", "^503: a"),
    "a huge code": Attack(numbered_error, "permanent", "^400"),
    "very deep error": Attack(
        lambda vendor: raw("[" * DEEP, "application/json", 400), "permanent", "^400"
    ),
    "an endless line": Attack(endless("data: ", MEGABYTE), "transient", "than 4 MB"),
    "an endless line, no field": Attack(endless("", MEGABYTE), "transient", "4 MB"),
    "an endless event": Attack(endless("", LINES), "transient", "than 1000 lines"),
    "an endless page": Attack(
        endless("<html>", MEGABYTE, content="text/html"), "transient", "than 4 MB"
    ),
    "an endless error": Attack(
        endless("{", MEGABYTE, 500, "application/json"), "transient", "^500"
    ),
    "an endless refusal": Attack(
        endless('"', MEGABYTE, 401, "application/json"), "permanent", "^401"
    ),
    "a gzip bomb": Attack(bomb(200), "transient", r"compresses its answer \(gzip\)"),
    "a gzip bomb as an error": Attack(bomb(503), "transient", "^503"),
    "three million characters": Attack(
        long_text, "transient", "more than 2000000 characters"
    ),
}
