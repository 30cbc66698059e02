"""`scripted:SCRIPT`: a stand-in for a model that draws from prepared controllers.

No model is asked. It is for rehearsals and simulations of the loop: how often its
controllers are right is known beforehand. What it answers depends on the script's seed,
the task, and on which question of which run it is, and on nothing else.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from tdac_agent.builtin.parameters import changed, names_of
from tdac_agent.builtin.provider import template_of
from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import Kind, Reply, Request
from tdac_agent.storage.shipped import shipped
from tdac_agent.storage.yaml_file import read_yaml
from tdac_agent.tasks.provenance import sha256_of
from tdac_agent.tasks.setting import Setting
from tdac_envs.core.errors import hint
from tdac_envs.core.intake import TEXT_BYTES, read_file

_KINDS: tuple[Kind, ...] = ("generate", "edit")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Choice(_Strict):
    """One controller of a script: the template of `builtin`, or a file."""

    weight: float = Field(1.0, gt=0, description="Where it is drawn.")
    file: Path | None = Field(None, description="Relative to the script.")
    parameters: dict[str, float] = Field({}, description="Of the template.")

    @model_validator(mode="after")
    def _one_source(self) -> Choice:
        if self.file is not None and self.parameters:
            raise ValueError("expected a file, or parameters of the template")
        return self


class Script(_Strict):
    """Contents of a script, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    about: str = ""
    seed: int = Field(0, ge=0, description="Of the draws.")
    drawn: bool = Field(
        True, description="Else the k-th is for iteration k, the last one for the rest."
    )
    generate: tuple[Choice, ...] = Field(min_length=1)
    edit: tuple[Choice, ...] = Field(min_length=1)


def make(words: str, options: Options) -> Scripted:
    """The provider for a script: a shipped one by its name, or a file.

    Raises:
        ProviderError: The script cannot be used.
    """
    if not words:
        raise ProviderError(
            "scripted: needs a script, as in scripted:weak or scripted:my.yaml"
        )
    own = shipped(f"scripts/{words}.yaml")
    file = own if own.is_file() else Path(words)
    script = read_yaml(file, Script, "the script", ProviderError)
    sources = {
        kind: tuple(_source(choice, file, options.setting) for choice in choices)
        for kind, choices in zip(_KINDS, (script.generate, script.edit), strict=True)
    }
    return Scripted(words, script, sources)


class Scripted:
    """A provider; see `Provider`.

    Args:
        words: What the user calls the script.
        script: Its contents.
        sources: Of its controllers, by the kind of the question.
    """

    paid = False

    def __init__(
        self, words: str, script: Script, sources: dict[Kind, tuple[str, ...]]
    ) -> None:
        self.name = f"scripted:{words}"
        self._script = script
        self._sources = sources

    def answers_sha256(self) -> str:
        """Hash of all that it may answer, and of how it is drawn."""
        known = [self._script.model_dump(mode="json"), self._sources]
        return sha256_of(json.dumps(known, sort_keys=True).encode())

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`. It has no rules to give."""
        if request.kind == "summarise":
            return Reply("```json\n[]\n```\n")
        number = self._number(request)
        source = self._sources[request.kind][number]
        return Reply(f"```python\n{source}```\n", notes=(f"script: no. {number + 1}",))

    def _number(self, request: Request) -> int:
        """Which of the controllers is given."""
        run, k, j = request.sample
        script = self._script
        choices = script.edit if request.kind == "edit" else script.generate
        if not script.drawn:
            return min(k, len(choices)) - 1
        kind = _KINDS.index(request.kind)
        # Other tasks have other draws.
        task = zlib.crc32(request.prompt[: request.stable].encode())
        place = [script.seed, task, run, k, j, kind, request.turn]
        random = np.random.default_rng(place)
        weights = np.array([choice.weight for choice in choices])
        return int(random.choice(len(choices), p=weights / weights.sum()))


def _source(choice: Choice, script: Path, setting: Setting) -> str:
    """The source of a controller, with a line end at its end.

    Raises:
        ProviderError: There is no such file, or the template no such parameter.
    """
    if choice.file is None:
        return _filled_in(choice.parameters, script, setting)
    file = script.parent / choice.file
    try:
        return read_file(file, TEXT_BYTES).decode("utf-8").rstrip() + "\n"
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ProviderError(f"{script}: {file}: {reason}") from error


def _filled_in(values: dict[str, float], script: Path, setting: Setting) -> str:
    """The template of `builtin` with some parameters."""
    template = template_of(setting)
    known = names_of(template.kind)
    for name in set(values) - set(known):
        raise ProviderError(
            f"{script}: the template has no parameter {name!r}{hint(name, known)}; "
            f"known: {', '.join(known)}"
        )
    return template.render(changed(template.kind(), values))
