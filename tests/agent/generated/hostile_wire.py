"""What a hostile child might answer: conversations with one frame written otherwise.

A conversation is a list of moves, one for each request of the judge. What is usual
there is known (`USUAL`); of a generated one, one move is something else: another value,
of any type that the wire has, damaged bytes, another kind of frame, another sequence
number, bytes too many or too few. A move gets past the first check when it is one frame
with one value; of the moves that are generated at least half are.
"""

from __future__ import annotations

import os
import struct
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tdac_agent.sandbox import Limits
from tdac_agent.sandbox.channel import Channel
from tdac_agent.sandbox.conversation import Conversation
from tdac_agent.sandbox.ending import ChildUsage
from tdac_agent.sandbox.inner import wire
from tdac_agent.sandbox.inner.decode import decode
from tdac_agent.sandbox.inner.encode import encode
from tdac_agent.sandbox.inner.wire import HEADER, Handle, Kind, RemoteError, WireError
from tdac_agent.sandbox.process import Child
from tdac_agent.sandbox.waiting import RunQueue

LIMITS = Limits(call_seconds=60.0, import_seconds=60.0, reset_seconds=60.0)
FRAME_BYTES = 1 << 20
TEXTS = st.text(st.characters(exclude_categories=()), max_size=20) | st.sampled_from(
    ["", "\x1b[2J\x1b[Hverified", "\ud800", "a" * 5000, "x\ny", "policy", "__class__"]
)
NAMES = st.sampled_from(["generator", "OccMap2D", "_Thing9", "module"]) | TEXTS
NUMBERS = (
    st.integers(-(2**4000), 2**4000)
    | st.floats()
    | st.sampled_from([2**63, -(2**63) - 1, 1e30, 1e31, 1e300, -0.0, 5e-324])
)
SCALARS = st.sampled_from(wire.DTYPES).flatmap(lambda d: hnp.arrays(d, ()))
ARRAYS = st.sampled_from(wire.DTYPES).flatmap(
    lambda d: hnp.arrays(d, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0))
)
WIDE = st.sampled_from(
    [np.zeros(shape) for shape in ((4,) * 8, (0, 10**6), (2**16,), (1,) * 8, (2, 1))]
)
ERRORS = st.builds(RemoteError, NAMES, TEXTS, TEXTS, st.integers(0, 2**32 - 1))
HANDLES = st.builds(Handle, st.integers(0, 2**32 - 1), NAMES)
LEAVES = (
    st.none()
    | st.booleans()
    | NUMBERS
    | TEXTS
    | st.binary(max_size=20)
    | SCALARS.map(lambda array: array[()])
    | ARRAYS
    | WIDE
    | HANDLES
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(TEXTS | NUMBERS | st.none(), inner, max_size=4)
    ),
    max_leaves=10,
)
PAIRS = st.tuples(LEAVES, LEAVES) | st.lists(LEAVES, min_size=2, max_size=2)


@dataclass(frozen=True, slots=True)
class Move:
    """One answer of the child.

    Attributes:
        kind: Of the frame.
        payload: Its bytes.
        offset: Of the sequence number from the one that is due.
        more: Bytes behind the frame.
        cut: Bytes that are missing at its end; then the child ends.
        size: Length that the header says, where not that of the payload.
    """

    kind: int
    payload: bytes
    offset: int = 0
    more: bytes = b""
    cut: int = 0
    size: int | None = None

    def raw(self, sequence: int) -> bytes:
        """The bytes that are written."""
        size = len(self.payload) if self.size is None else self.size
        due = (sequence + self.offset) & 0xFFFFFFFF
        raw = HEADER.pack(size, self.kind, due) + self.payload + self.more
        return raw[: len(raw) - self.cut]

    def gets_in(self) -> bool:
        """Whether it is one frame with one value."""
        whole = not self.more and not self.cut and self.size is None
        try:
            decode(self.payload)
        except WireError:
            return False
        return whole and len(self.payload) <= FRAME_BYTES


def value(of: object, kind: int = Kind.VALUE) -> Move:
    """A well-formed answer."""
    return Move(kind, encode(of))


STEP = value((1.0, 0.5), Kind.ENV_STEP)
USUAL: dict[str, tuple[Move, ...]] = {
    "policy": (value({"policy": "function"}), value(None), *[value((1.0, 0.8))] * 6),
    "own loop": (
        value({"run_episode": "function"}),
        value(None, Kind.ENV_RESET),
        *[STEP] * 4,
        value({"positions": [(1.0, 2.0)], "speeds": [], "collisions": 0, "goal": True}),
    ),
    "calls": (
        value({"OccMap2D": "type", "LOOKAHEAD": "int"}),
        value(Handle(1, "OccMap2D")),
        value(True),
        value([(1, 2), (3, 4)]),
        value(12),
    ),
}
"""By what the judge does."""


def _encoded(of: object) -> bytes:
    try:
        return encode(of)
    except WireError:
        return encode(None)


@st.composite
def moves(draw: st.DrawFn, usual: Move) -> Move:
    """Something else than a usual answer."""
    kind = draw(st.integers(0, 11))
    if kind <= 5:
        odd = draw(PAIRS if kind <= 2 else VALUES)
        return replace(usual, payload=_encoded(odd))
    if kind == 6:
        return Move(Kind.ERROR, _encoded(draw(ERRORS | VALUES)))
    if kind == 7:
        return replace(usual, kind=draw(st.integers(0, 255)))
    return replace(usual, **draw(broken()))


@st.composite
def broken(draw: st.DrawFn) -> dict[str, Any]:
    """Fields of a move that is hardly a frame, or hardly a value."""
    kind, raw = draw(st.integers(0, 3)), bytearray(_encoded(draw(VALUES)))
    if kind == 0:
        return {"offset": draw(st.integers(-2, 2))}
    if kind == 1:
        raw[draw(st.integers(0, len(raw) - 1))] = draw(st.integers(0, 255))
        return {"payload": bytes(raw)}
    if kind == 2:
        count = draw(st.sampled_from([0, 5, 2**20, 2**31, 2**32 - 1]))
        tag = draw(st.sampled_from(list(b"ldtasbIh")))
        return {"payload": bytes([tag]) + struct.pack("<I", count) + bytes(raw)}
    size = draw(st.sampled_from([None, 0, 1, 2**20 + 1, 2**32 - 1]))
    more, cut = draw(st.binary(max_size=12)), draw(st.integers(0, 8))
    return {"more": more, "cut": cut, "size": size}


@st.composite
def conversations(draw: st.DrawFn) -> tuple[str, list[Move], int]:
    """What the judge does, the child's answers, and which of them is unusual."""
    name = draw(st.sampled_from(sorted(USUAL)))
    script = list(USUAL[name])
    at = draw(st.integers(0, len(script) - 1))
    script[at] = draw(moves(script[at]))
    if draw(st.integers(0, 9)) == 0:
        script = script[: at + 1]
    return name, script, at


class Peer(Child):
    """A child whose answers are known; it lives in a thread. A context manager.

    Args:
        script: Its answers, one for each request; after the last one it ends.
    """

    def __init__(self, script: list[Move]) -> None:
        self.tier, self.limits = "none", LIMITS
        self.pid = os.getpid()  # a thread has no CPU time of its own
        self._line = RunQueue("thread-self")
        pipes = [os.pipe() for _ in range(4)]
        (requests, to), (answers, back), (output, printed), (life, lifeline) = pipes
        self._ours = (lifeline,)
        channel = Channel(to, answers, output, FRAME_BYTES, 1 << 16)
        self._closed = False
        self._channel = channel
        ends = channel, self._line, lifeline
        self._talk = Conversation(*ends, LIMITS, Path("/x"), self._end)
        theirs = (requests, back, printed, life)
        self._thread = threading.Thread(target=_answer, args=(script, theirs))
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self.close()
        self._thread.join(60.0)
        assert not self._thread.is_alive()

    def _end(self) -> ChildUsage:
        if not self._closed:
            self._closed = True
            self._channel.close()
            for descriptor in self._ours:
                os.close(descriptor)
        return ChildUsage(0.0, 0, 0, "", "", 0)


def _answer(script: list[Move], descriptors: tuple[int, ...]) -> None:
    """Answers each request by the next move, then closes everything."""
    requests, back, *_ = descriptors
    try:
        for move in script:
            size, _, sequence = HEADER.unpack(_read(requests, HEADER.size))
            _read(requests, size)
            raw = memoryview(move.raw(sequence))
            while raw:
                raw = raw[os.write(back, raw) :]
            if move.cut:
                return
        os.read(requests, 1)
    except (BrokenPipeError, EOFError):
        pass
    finally:
        for descriptor in descriptors:
            os.close(descriptor)


def _read(descriptor: int, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = os.read(descriptor, size - len(data))
        if not part:
            raise EOFError
        data += part
    return data


def told(result: Any) -> str:
    """What a report may quote of a value."""
    from tdac_agent.episodes.episode import wrong_action

    return wrong_action(result)
