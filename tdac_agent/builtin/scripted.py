"""Provider `scripted:SCRIPT`: draws prepared controllers instead of asking a model.

It is for dry runs and simulations of the loop: the success rate of its controllers is
known in advance. An answer depends only on the script's seed, the task, the run and the
position of the question in the run.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field, model_validator

from tdac_agent.builtin.provider import template_of
from tdac_agent.builtin.template import names_of
from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import Kind, Reply, Request
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.shipped import shipped
from tdac_agent.storage.yaml_file import read_yaml
from tdac_agent.tasks.setting import Setting
from tdac_envs.core.errors import hint
from tdac_envs.core.intake import TEXT_BYTES, read_file
from tdac_envs.core.strict_model import StrictModel

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

_KINDS: tuple[Kind, ...] = ("generate", "edit")


class Choice(StrictModel):
    """A controller of a script: the template of `builtin`, or a file."""

    weight: float = Field(1.0, gt=0, description="Relative probability of a draw.")
    file: Path | None = Field(None, description="Path relative to the script.")
    parameters: dict[str, float] = Field({}, description="Template parameters.")

    @model_validator(mode="after")
    def _one_source(self) -> Choice:
        if self.file is not None and self.parameters:
            raise ValueError("expected a file or template parameters, not both")
        return self


class Script(StrictModel):
    """Contents of a script, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    about: str = ""
    seed: int = Field(0, ge=0, description="Seed of the draws.")
    drawn: bool = Field(
        True, description="If false, iteration k uses the k-th choice, or the last one."
    )
    generate: tuple[Choice, ...] = Field(min_length=1)
    edit: tuple[Choice, ...] = Field(min_length=1)


def make(words: str, options: Options) -> Scripted:
    """Returns the provider for a script: a shipped one by its name, or a file.

    Raises:
        ProviderError: The script cannot be used.
    """
    if not words:
        raise ProviderError(
            "scripted: needs a script, as in scripted:weak or scripted:my.yaml"
        )
    setting = options.setting
    assert setting is not None
    own = shipped(f"scripts/{words}.yaml")
    file = own if own.is_file() else Path(words)
    script = read_yaml(file, Script, "the script", ProviderError)
    sources = {
        kind: tuple(_source(choice, file, setting) for choice in choices)
        for kind, choices in zip(_KINDS, (script.generate, script.edit), strict=True)
    }
    return Scripted(words, script, sources)


class Scripted:
    """A provider; see `Provider`.

    Args:
        words: Name or path of the script.
        script: Its contents.
        sources: Sources of its controllers, by kind of request.
    """

    paid = False

    def __init__(
        self, words: str, script: Script, sources: dict[Kind, tuple[str, ...]]
    ) -> None:
        self.name = f"scripted:{words}"
        self._script = script
        self._sources = sources

    def answers_sha256(self) -> str:
        """Returns the hash of all possible answers and of how they are drawn."""
        known = [self._script.model_dump(mode="json"), self._sources]
        return sha256_of(json.dumps(known, sort_keys=True).encode())

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`. Adds no rules."""
        if request.kind == "summarise":
            return Reply("```json\n[]\n```\n")
        number = self._number(request)
        source = self._sources[_kind_of(request)][number]
        return Reply(f"```python\n{source}```\n", notes=(f"script: no. {number + 1}",))

    def _number(self, request: Request) -> int:
        """Returns the index of the controller that answers a request."""
        run, k, j = request.sample
        script = self._script
        choices = script.generate if request.kind == "generate" else script.edit
        if not script.drawn:
            return min(k, len(choices)) - 1
        kind = _KINDS.index(_kind_of(request))
        # Each task has its own draws.
        task = zlib.crc32(request.prompt[: request.stable].encode())
        seed = [script.seed, task, run, k, j, kind, request.turn]
        random = np.random.default_rng(seed)
        weights = np.array([choice.weight for choice in choices])
        return int(random.choice(len(choices), p=weights / weights.sum()))


def _kind_of(request: Request) -> Kind:
    """The kind whose choices answer a request: those of `edit` also improve."""
    return "generate" if request.kind == "generate" else "edit"


def _source(choice: Choice, script: Path, setting: Setting | TaskSet) -> str:
    """Returns the source of a controller, ending in a newline.

    Raises:
        ProviderError: The file cannot be read, or a parameter is unknown.
    """
    if choice.file is None:
        return _filled_in(choice.parameters, script, setting)
    file = script.parent / choice.file
    try:
        return read_file(file, TEXT_BYTES).decode("utf-8").rstrip() + "\n"
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ProviderError(f"{script}: {file}: {reason}") from error


def _filled_in(
    values: dict[str, float], script: Path, setting: Setting | TaskSet
) -> str:
    if not isinstance(setting, Setting):
        raise ProviderError(
            f"{script}: a task set has no template; name files with `file:` instead"
        )
    template = template_of(setting)
    known = names_of(template.kind)
    for name in set(values) - set(known):
        raise ProviderError(
            f"{script}: the template has no parameter {name!r}{hint(name, known)}; "
            f"known: {', '.join(known)}"
        )
    return template.render(template.kind().changed(**values))
