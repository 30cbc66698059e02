"""Policies that somebody else offers, as if stable-baselines3 had saved them."""

from __future__ import annotations

import io
import json
import os
import pickle
import zipfile
from collections import OrderedDict
from pathlib import Path
from typing import Any

from offered_maps import link, pipe, text
from offers import Maker, Offer

NAME = "policy.zip"
WORDS = ("evaluate", NAME, "--task", "maze", "--episodes", "1")
DATA: dict[str, Any] = {
    "policy_class": {"__module__": "stable_baselines3.common.policies"},
    "policy_kwargs": {},
    "use_sde": False,
}
SAID = {"schema_version": 1, "algo": "ppo", "wrappers": ["flatten"]}
DEFLATED = zipfile.ZIP_DEFLATED


class Call:
    """What a pickle calls when it is loaded."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self._call = function, arguments

    def __reduce__(self) -> tuple[Any, ...]:
        return self._call


def zipped(parts: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    """A zip file."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return content.getvalue()


def weights(value: Any = None) -> bytes:
    """A file of torch that holds a pickled value, by default no weights at all."""
    pickled = pickle.dumps(OrderedDict() if value is None else value, protocol=2)
    version = {"archive/version": b"3\n", "archive/byteorder": b"little"}
    return zipped({"archive/data.pkl": pickled} | version)


def policy(
    data: object = DATA,
    pth: bytes | None = None,
    said: object = SAID,
    method: int = zipfile.ZIP_STORED,
) -> bytes:
    """A policy's file; what is not bytes is written as JSON."""

    def raw(part: object) -> bytes:
        return part if isinstance(part, bytes) else json.dumps(part).encode()

    inner = weights() if pth is None else pth
    parts = {"data": raw(data), "policy.pth": inner, "tdac.json": raw(said)}
    return zipped(parts, method)


def kwargs(**given: object) -> bytes:
    """A policy's file with some settings of the network."""
    return policy(DATA | {"policy_kwargs": given})


def _offer(
    name: str, make: Maker | bytes, says: str, endless: bool = False, needs: str = ""
) -> Offer:
    make = text(NAME, make) if isinstance(make, bytes) else make
    return Offer("policies", name, WORDS, make, says, endless=endless, needs=needs)


def network(name: str, make: Maker | bytes, says: str) -> Offer:
    """Where the network is made, or its weights are read."""
    return _offer(name, make, says, needs="stable_baselines3")


def _bomb(here: Path) -> None:
    """A few hundred kilobytes that are 150 MB."""
    (here / NAME).write_bytes(policy(bytes(150_000_000), method=DEFLATED))


def _inner_bomb(here: Path) -> None:
    inner = zipped({"archive/data.pkl": bytes(150_000_000)}, DEFLATED)
    (here / NAME).write_bytes(policy(pth=inner))


def _bzip2(here: Path) -> None:
    (here / NAME).write_bytes(policy(bytes(9_000_000), method=zipfile.ZIP_BZIP2))


def _lying(here: Path) -> None:
    """Its directory says 5 bytes of what are 150 MB."""
    size = (150_000_000).to_bytes(4, "little")
    raw = policy(bytes(150_000_000), method=DEFLATED)
    (here / NAME).write_bytes(raw.replace(size, (5).to_bytes(4, "little")))


def _crowded(here: Path) -> None:
    parts = {f"{number}": b"" for number in range(20_000)}
    (here / NAME).write_bytes(zipped(parts))


def _sparse(here: Path) -> None:
    (here / NAME).touch()
    os.truncate(here / NAME, 10**12)


_FITTING = {
    "log_std": (2,),
    "action_net.weight": (2, 4),
    "action_net.bias": (2,),
    "value_net.weight": (1, 4),
    "value_net.bias": (1,),
}
"""Shapes of the weights of a network without layers."""


def _tensors(make: str, data: object = DATA) -> Maker:
    """A policy with weights of torch's own making."""

    def write(here: Path) -> None:
        import torch

        content = io.BytesIO()
        torch.save(eval(make, {"torch": torch, "fitting": _FITTING}), content)
        (here / NAME).write_bytes(policy(data, pth=content.getvalue()))

    return write


def _beside(make: Maker) -> Maker:
    """A policy that says nothing of itself, and a file beside it that may."""

    def write(here: Path) -> None:
        parts = {"data": json.dumps(DATA).encode(), "policy.pth": weights()}
        (here / NAME).write_bytes(zipped(parts))
        make(here)

    return write


OFFERS = [
    _offer("endless", link(NAME, "/dev/zero"), "no policy", True),
    _offer("pipe", pipe(NAME), "no policy", True),
    _offer("sparse", _sparse, "larger than 128 MB"),
    _offer("no_zip", b"no zip", "not a stable-baselines3 policy"),
    _offer("torn", policy()[:-30], "not a stable-baselines3 policy"),
    _offer("empty", zipped({}), "has no `data`"),
    _offer("no_weights", zipped({"data": b"{}"}), "no `policy.pth`"),
    _offer("crowded", _crowded, "more than 10000 files"),
    _offer("bomb", _bomb, "more than 2.17 MB when unpacked"),
    _offer("inner_bomb", _inner_bomb, "more than 0.146 MB when unpacked"),
    _offer("other_method", _bzip2, "unsupported compression method"),
    _offer("lying", _lying, "damaged zip file"),
    _offer("data_torn", policy(b"{"), "its `data` is damaged"),
    _offer("data_deep", policy(b"[" * 100_000), "its `data` is damaged"),
    _offer("data_list", policy([]), "its `data` is damaged"),
    _offer("data_not_text", policy(b"\xff"), "its `data` is damaged"),
    _offer("class_text", policy(DATA | {"policy_class": "x"}), "`data` is damaged"),
    _offer(
        "class_unknown",
        policy(DATA | {"policy_class": {"__module__": "os"}}),
        "a policy from os cannot be evaluated",
    ),
    _offer("kwargs_list", policy(DATA | {"policy_kwargs": [1]}), "`data` is damaged"),
    _offer("kwargs_code", kwargs(features_extractor_class="<class 'os.X'>"), "is code"),
    _offer("kwargs_unknown", kwargs(anything=1), "unknown key"),
    _offer("wide_layer", kwargs(net_arch=[10**9]), "net_arch"),
    _offer("many_layers", kwargs(net_arch=[8] * 10_000), "net_arch"),
    _offer("no_layer", kwargs(net_arch=[-1]), "net_arch"),
    _offer("nan_setting", kwargs(log_std_init=float("nan")), "log_std_init"),
    _offer("activation", kwargs(activation_fn="<class 'os.system'>"), "activation_fn"),
    network(
        "no_activation",
        kwargs(activation_fn="<class 'torch.nn.modules.activation.Nope'>"),
        "Nope",
    ),
    network("of_another_class", kwargs(n_critics=2), "do not fit its class"),
    _offer("weights_torn", policy(pth=b"\x80\x02"), "`policy.pth` is damaged"),
    _offer("weights_code", policy(pth=weights(Call(os.system, "true"))), "holds more"),
    _offer("weights_large", policy(pth=weights(Call(bytearray, 10**11))), "holds more"),
    network("weights_list", policy(pth=weights([1, 2])), "weights"),
    network(
        "weights_nan",
        _tensors(
            "{name: torch.full(size, float('nan')) for name, size in fitting.items()}",
            DATA | {"policy_kwargs": {"net_arch": []}},
        ),
        "finite",
    ),
    network("weights_whole", _tensors("{'a': torch.zeros(2).to(int)}"), "holds more"),
    _offer("said_torn", policy(said=b"{"), "tdac.json"),
    _offer("said_deep", policy(said=b"[" * 9999), "nested deeper"),
    _offer("said_wrapper", policy(said=SAID | {"wrappers": ["os"]}), "unknown wrapper"),
    _offer("said_unknown", policy(said=SAID | {"run": "x"}), "unknown key"),
    _offer("beside_pipe", _beside(pipe("policy.json")), "does not say which", True),
    _offer("beside_deep", _beside(text("policy.json", "[" * 9999)), "nested deeper"),
]
