"""Policies of a few kilobytes that would cost gigabytes.

Networks whose weights the file does not have, weights whose numbers it does not have,
and files that its readers understand in different ways.
"""

from __future__ import annotations

import pickle
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

from offered_policies import (
    DATA,
    DEFLATED,
    NAME,
    Call,
    kwargs,
    network,
    policy,
    weights,
    zipped,
)
from offers import Maker, Offer

LITTLE = 600_000_000
"""Bytes; torch alone takes 250 MB, and tdac 150 MB."""


def _small(name: str, make: Maker | bytes, says: str) -> Offer:
    """What must take hardly more memory than a policy of some kilobytes."""
    return replace(network(name, make, says), memory=LITTLE)


def _of(module: str, **given: object) -> dict[str, Any]:
    """Settings of a network of another class."""
    return {"policy_class": {"__module__": module}, "policy_kwargs": given}


_SAC = "stable_baselines3.sac.policies"
_TD3 = "stable_baselines3.td3.policies"
_RECURRENT = "sb3_contrib.common.recurrent.policies"
_MEMORY = "tdac_agent.episodes.memory_policy"
_WIDE = [4096] * 16
"""Layers of a billion bytes."""
_LAYERS = {"mlp_extractor.policy_net.0.weight": (4096, 4)}
_LAYERS |= {f"mlp_extractor.policy_net.{2 * i}.weight": (4096, 4096) for i in (1, 2, 3)}


def _tensor(
    count: int, shape: tuple[int, ...], strides: tuple[int, ...], offset: int = 0
) -> bytes:
    """The operations that make a tensor of the storage `0`, which claims `count`."""

    def numbers(values: tuple[int, ...]) -> bytes:
        return b"(" + b"".join(b"J" + struct.pack("<i", v) for v in values) + b"t"

    storage = b"(X\7\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpu"
    return (
        b"ctorch._utils\n_rebuild_tensor_v2\n("
        + storage
        + b"J"
        + struct.pack("<i", count)
        + b"tQJ"
        + struct.pack("<i", offset)
        + numbers(shape)
        + numbers(strides)
        + b"\x89}tR"
    )


def _named(tensors: dict[str, bytes]) -> bytes:
    """A pickle of a dictionary of tensors."""
    items = (
        b"X" + struct.pack("<I", len(name)) + name.encode() + made
        for name, made in tensors.items()
    )
    return b"\x80\2}(" + b"".join(items) + b"u."


def _claims(
    data: dict[str, Any],
    count: int,
    strides: tuple[int, int],
    shape: tuple[int, int] | None = None,
    offset: int = 0,
    stored: int = 4,
) -> bytes:
    """A policy whose layers are one small storage, looked at in some way."""
    tensors = {
        name: _tensor(count, shape or size, strides, offset)
        for name, size in _LAYERS.items()
    }
    inner = {"archive/data.pkl": _named(tensors), "archive/data/0": bytes(4 * stored)}
    return policy(data, zipped(inner | _VERSION))


_VERSION = {"archive/version": b"3\n", "archive/byteorder": b"little"}
_PLAIN = DATA | {"policy_kwargs": {"net_arch": {"pi": [4096] * 4, "vf": []}}}
_ONE = {"a": _tensor(4, (4,), (1,))}


def _pth(pickled: bytes, **more: bytes) -> bytes:
    """A policy with a pickle of weights, and more files beside it."""
    parts = {"archive/data.pkl": pickled, "archive/data/0": bytes(16)} | more
    return policy(pth=zipped(parts | _VERSION))


def _two_pickles() -> bytes:
    bomb = pickle.dumps(Call(bytearray, 10**10), protocol=2)
    parts = {"aaa/data.pkl": _named(_ONE), "archive/data.pkl": bomb}
    return policy(pth=zipped(parts | {"archive/data/0": bytes(16)} | _VERSION))


def _twice() -> bytes:
    """Two files of the same name; who reads the first may load the second."""
    bomb = pickle.dumps(Call(bytearray, 10**10), protocol=2)
    parts = {"archive/data.pkl": bomb, "archive/data.pkX": _named(_ONE)}
    return policy(pth=zipped(parts | _VERSION).replace(b"data.pkX", b"data.pkl"))


def _prefixed() -> bytes:
    """A zip file behind a file of torch's older kind, which is not one."""
    bomb = pickle.dumps(Call(bytearray, 10**10), protocol=2)
    inner = {"archive/data.pkl": _named(_ONE), "archive/data/0": bytes(16)}
    return policy(pth=bomb + zipped(inner | _VERSION))


def _overlapping(here: Path) -> None:
    """Thousands of storages that are the same bytes of the file."""
    inner = {"archive/data.pkl": _named(_ONE), "archive/data/0000": bytes(50_000)}
    raw = zipped(inner)
    begin, end = raw.index(b"PK\1\2"), raw.index(b"PK\5\6")
    last = raw.index(b"PK\1\2", begin + 4)
    entries = raw[begin:last] + b"".join(
        raw[last:end].replace(b"/0000", b"/%04d" % number) for number in range(2000)
    )
    tail = struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 2001, 2001, len(entries), begin, 0)
    (here / NAME).write_bytes(policy(pth=raw[:begin] + entries + tail))


def _zeros(here: Path) -> None:
    """A hundred kilobytes that are 100 MB of weights."""
    inner = {"archive/data.pkl": _named(_ONE), "archive/data/0": bytes(100_000_000)}
    raw = policy(pth=zipped(inner | _VERSION), method=DEFLATED)
    (here / NAME).write_bytes(raw)


def _zeros_twice(here: Path) -> None:
    """The same, packed once more: a kilobyte."""
    inner = {"archive/data.pkl": _named(_ONE), "archive/data/0": bytes(100_000_000)}
    raw = policy(pth=zipped(inner | _VERSION, DEFLATED), method=DEFLATED)
    (here / NAME).write_bytes(raw)


def _text(value: str) -> bytes:
    return b"X" + struct.pack("<I", len(value)) + value.encode()


_SHARED = b"K\1" + b"".join(b"q%ch%c\x86" % (i, i) for i in range(59))
"""Pairs of pairs of pairs: whoever looks at all of them never ends."""
_SHARED_KEY = b"(" + _text("storage") + b"ctorch\nFloatStorage\n" + _SHARED
_EMPTY = b"ccollections\nOrderedDict\n"


def _hidden(items: bytes, size: int) -> bytes:
    """A dictionary whose own methods say that it is empty."""
    state = _text("items") + _EMPTY + _text("values") + _EMPTY
    pickled = b"\x80\2" + _EMPTY + b")R(" + items + b"u}(" + state + b"ub."
    inner = zipped({"archive/data.pkl": pickled, "archive/data/0": bytes(size)})
    return policy(pth=inner, method=DEFLATED)


_HALVES = _tensor(400_000, (400_000,), (1,)).replace(b"FloatS", b"HalfS")
_MANY = b"".join(_text(f"t{number}") + _HALVES for number in range(1200))


OFFERS = [
    _small("wide", kwargs(net_arch=_WIDE), "do not fit its settings"),
    _small("wide_parts", kwargs(net_arch={"pi": _WIDE, "vf": _WIDE}), "do not fit its"),
    _small(
        "wide_noise",
        kwargs(net_arch=_WIDE, use_sde=True, full_std=True),
        "do not fit its settings",
    ),
    _small(
        "wide_sac", policy(_of(_SAC, net_arch=_WIDE, n_critics=8)), "do not fit its"
    ),
    _small(
        "wide_td3", policy(_of(_TD3, net_arch=_WIDE, n_critics=8)), "do not fit its"
    ),
    _small(
        "wide_lstm",
        policy(_of(_RECURRENT, lstm_hidden_size=4096, n_lstm_layers=8)),
        "do not fit its settings",
    ),
    _small(
        "wide_memory",
        policy(_of(_MEMORY, lstm_hidden_size=4096, net_arch=_WIDE)),
        "do not fit its settings",
    ),
    _small("wide_with_weights", policy(_PLAIN, weights()), "do not fit its settings"),
    _small("no_strides", _claims(_PLAIN, 4, (0, 0)), "does not store each"),
    _small("one_stride", _claims(_PLAIN, 4, (1, 1)), "does not store each"),
    _small("view_beyond", _claims(_PLAIN, 4, (4, 1), (2, 4)), "beyond its storage"),
    _small(
        "offset_beyond", _claims(_PLAIN, 4, (1, 1), (1, 1), 2**30), "beyond its storage"
    ),
    _small(
        "offset_before", _claims(_PLAIN, 4, (1, 1), (1, 1), -1), "beyond its storage"
    ),
    _small("size_negative", _claims(_PLAIN, 4, (-1, 1), (-1, -1)), "or of none"),
    _small("storage_claims", _claims(_PLAIN, 2**28, (4096, 1)), "claims 1073741824"),
    _small(
        "storage_shared",
        _claims(_PLAIN, 2**20, (1, 1), (1, 2**20), stored=2**20),
        "larger than the file",
    ),
    _small("storage_zeros", _zeros, "MB when unpacked"),
    _small("storage_zeros_twice", _zeros_twice, "MB when unpacked"),
    _small("storage_overlaps", _overlapping, "MB when unpacked"),
    _small("two_pickles", _two_pickles(), "expected one data.pkl, got 2"),
    _small("pickle_twice", _twice(), "two files of one name"),
    _small("behind_a_pickle", _prefixed(), "damaged|do not fit its"),
    _small("memo", _pth(b"\x80\2}r\xff\xff\xff\x7f."), "do not fit its"),
    _small("long", _pth(b"\x80\2}\x8b\xff\xff\xff\x7f1."), "damaged"),
    _small("deep", _pth(b"\x80\2})" + b"\x85" * 10**6 + b"Ns."), "nests tuples"),
    _small(
        "deep_enough", _pth(b"\x80\2})" + b"\x85" * 29_000 + b"Ns."), "nests tuples"
    ),
    _small(
        "many_tensors",
        _pth(_named({f"a{i}": _tensor(4, (4,), (1,)) for i in range(50_000)})),
        "more than 30000",
    ),
    _small(
        "many_sizes", _pth(_named({"a": _tensor(1, (1,) * 4000, (1,) * 4000)})), "4000"
    ),
    _small("hidden", _hidden(_text("a") + b"N", 16), "not tensors by name"),
    _small("hidden_tensors", _hidden(_MANY, 800_000), "larger than the file"),
    _small("shared_name", _pth(b"\x80\2}(" + _SHARED + b"K\1u."), "uses again"),
    _small(
        "shared_key",
        _pth(b"\x80\2}(" + _text("a") + _SHARED_KEY + b"X\3\0\0\0cpuK\4tQu."),
        "uses again",
    ),
]
