"""The entry point `inspect_ai`: a task for each bundled task and for each level.

`tdac_maze` and the like are bundled maps, `tdac_epuck_arena` and the like bundled
worlds of the e-puck, and `tdac_unknown` and the like the levels; `tdac_epuck` is the
level of this name.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from inspect_ai import Task, task
from inspect_ai.dataset import Sample
from inspect_ai.scorer import Scorer

from tdac_agent.falsify.falsify import LEAST, MOST_EPISODES
from tdac_agent.inspect_tasks.names import registered
from tdac_agent.inspect_tasks.scoring import driven, passed
from tdac_agent.inspect_tasks.solvers import repair, tdac_builtin
from tdac_agent.synthesis.answers import exam_of, files_of
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.registry import own_environments
from tdac_envs.core.arguments import whole_number
from tdac_envs.ladder.set_file import set_names

__all__ = ["driven", "passed", "repair", "tdac_builtin"]
WORLDS = 20
"""Worlds on which an answer for a level drives."""


def single_tasks() -> dict[str, str]:
    """The bundled tasks by their names in Inspect.

    One that is called like a level has the name of its map or world, too.
    """
    return {
        _name(f"{name} {place}" if name in set_names() else name): name
        for name, place in _bundled()
    }


def level_tasks() -> dict[str, str]:
    """The levels by their names in Inspect."""
    return {_name(name): name for name in set_names()}


def _bundled() -> Iterator[tuple[str, str]]:
    for one in own_environments():
        yield from one.bundled().items()


def _name(name: str) -> str:
    return f"tdac_{name.replace('-', '_').replace(' ', '_')}"


def _register_single(inspect_name: str, name: str) -> None:
    @task(name=registered(inspect_name))
    def bundled(envelope: int = 0) -> Task:
        about: dict[str, Any] = {"task": name}
        if envelope:
            whole_number("envelope", envelope, LEAST, MOST_EPISODES)
            about["envelope"] = envelope
        return _task(name, about, passed())


def _register_level(inspect_name: str, name: str) -> None:
    @task(name=registered(inspect_name))
    def level(
        worlds: int = WORLDS, split: str = "test", salt_file: str | None = None
    ) -> Task:
        # Inspect may change the working folder later.
        salt = None if salt_file is None else Path(salt_file).absolute()
        about: dict[str, Any] = {"level": name, "worlds": worlds, "split": split}
        if salt is not None:
            about["salt_file"] = str(salt)
        return _task(name, about, driven())


def _task(name: str, about: dict[str, Any], judge: Scorer) -> Task:
    """A task of one sample: the question for one controller."""
    exam = exam_of(about)  # checks the values
    sample = Sample(
        input=exam.question(),
        target="a controller.py that passes",
        id=name,
        metadata=about,
        files={name: _data_uri(raw) for name, raw in files_of(exam.problem).items()},
    )
    return Task(dataset=[sample], scorer=judge, version=versions()["tdac"])


def _data_uri(raw: bytes) -> str:
    """The contents of a file, as Inspect copies them into an agent's sandbox."""
    text = base64.b64encode(raw).decode("ascii")
    return f"data:application/octet-stream;base64,{text}"


for _inspect_name, _tdac_name in single_tasks().items():
    _register_single(_inspect_name, _tdac_name)
for _inspect_name, _tdac_name in level_tasks().items():
    _register_level(_inspect_name, _tdac_name)
