"""The movers of a task on a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from tdac_envs.map2d.placing import MoversSetup
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.spec import AnySpec


def check_movers(specs: Sequence[AnySpec], task: Map2DTask) -> None:
    """Places the movers of a task once.

    Raises:
        TaskError: They cannot be placed; the message names the mover.
    """
    if specs:
        MoversSetup.of(specs, task).start(task, np.random.default_rng(0))


def as_option(specs: Sequence[AnySpec]) -> dict[str, list[dict[str, Any]]]:
    """The argument `movers` of an environment, JSON-able; empty without movers.

    So tasks without movers keep the hash that they had before there were any.
    """
    options = [spec.model_dump(mode="json", exclude_none=True) for spec in specs]
    return {"movers": options} if options else {}


def sentence_on(specs: Sequence[AnySpec]) -> str:
    """A sentence for prompts; empty without movers."""
    counts = Counter[str]()
    for spec in specs:
        counts[spec.kind] += spec.number
    if not counts:
        return ""
    parts = [_WORDS[kind][count > 1].format(count) for kind, count in counts.items()]
    return (
        f"Beside the robot, {_joined(parts)} move about: they are not on the map, "
        "ranges end at them as at walls, and touching one is a collision."
    )


_WORDS = {
    "route": ("{} disc on a route", "{} discs on routes"),
    "bounce": (
        "{} disc that bounces off walls",
        "{} discs that bounce off walls",
    ),
    "crowd": (
        "{} person with a goal of their own",
        "a crowd of {} people with goals of their own",
    ),
}


def _joined(parts: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    *others, last = parts
    return f"{', '.join(others)} and {last}" if others else last
