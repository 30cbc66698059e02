"""The campaign file (YAML): its schema, how it is found and read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, JsonValue, model_validator

from tdac_agent.errors import ProviderError, RunError
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS
from tdac_agent.models.ready import needs_limit
from tdac_agent.prompting.prompt import is_shipped
from tdac_agent.runs.run_record import LoopSetting
from tdac_agent.storage.hashes import sha256_of_file
from tdac_agent.storage.shipped import shipped, shipped_names
from tdac_agent.storage.yaml_file import read_yaml
from tdac_agent.synthesis.options import PAPER, USUAL, SynthOptions
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.trust import Wish, asking, suite_wish
from tdac_envs.core.strict_model import StrictModel

SAME = "same"
"""Optimizer name for the learner itself."""
Keep = Literal["all", "records"]
_USUAL = SynthOptions()
_VARIED = ("learners", "optimizers", "settings", "prompts")


class CampaignError(RunError):
    """A campaign cannot be run with the given file or flags."""


class CampaignConfig(StrictModel):
    """Contents of a campaign file, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    about: str = ""
    tasks: tuple[str, ...] = Field(
        (), description="Bundled names, or files relative to this file."
    )
    sets: tuple[str, ...] = Field(
        (), description="Names of task sets, or files relative to this file."
    )
    learners: tuple[str, ...] = Field(min_length=1, description="As for --learner.")
    optimizers: tuple[str, ...] = Field(
        (SAME,), min_length=1, description="As for --optimizer; `same`: the learner."
    )
    settings: tuple[LoopSetting, ...] = Field(("dual tier",), min_length=1)
    prompts: tuple[str, ...] = Field(
        ("full",), min_length=1, description="As for --prompt."
    )
    runs: int = Field(5, ge=1, description="R: runs of each kind.")
    iterations: int = Field(20, ge=1, description="K, for the settings that repair.")
    patience: int = Field(
        1,
        ge=1,
        description="J, for the settings that edit; without edits, the "
        "settings are `prompt only`, `best of N` and `one shot`.",
    )
    samples: int | None = Field(
        None,
        ge=2,
        description="N of `best of N`; by default as many answers as the dual tier "
        "may request: K·(J + 2).",
    )
    episodes: int = Field(
        USUAL[PAPER]["episodes"],
        ge=2,
        le=MOST_EPISODES,
        description="As for --episodes, on sets.",
    )
    feedback_episodes: int = Field(
        _USUAL.feedback_episodes,
        ge=1,
        le=MOST_EPISODES,
        description="As for --feedback-episodes, on sets.",
    )
    seed: int | None = Field(
        None,
        ge=0,
        description="Seed of the first run, which determines jittered starts and the "
        "worlds of `dev`; later runs count up from it. The default is derived from a "
        "secret of the installation.",
    )
    base_url: str | None = Field(None, description="As for --base-url.")
    max_output: int = Field(MAX_OUTPUT_TOKENS, ge=1, description="As for --max-output.")
    options: dict[str, JsonValue] = Field(
        {},
        description="Further options of `tdac synth`, by the names of their flags with "
        "_ for -, such as `candidates` and `improve`.",
    )
    max_cost: float | None = Field(None, ge=0, description="Limit for all runs, USD.")
    max_tokens: int | None = Field(None, ge=0, description="Token limit for all runs.")
    keep: Keep = Field(
        "all", description="`records` keeps only what tables need of finished runs."
    )

    @model_validator(mode="after")
    def _usable(self) -> Self:
        if not self.tasks and not self.sets:
            raise ValueError("tasks: expected at least one, or one of sets")
        for name in ("tasks", "sets", *_VARIED):
            values = getattr(self, name)
            again = {value for value in values if values.count(value) > 1}
            if again:
                raise ValueError(f"{name}: {again.pop()!r} is listed twice")
        own = [
            name
            for name in self.options
            if name in (*type(self).model_fields, "refine", "omit")
        ]
        if own:
            raise ValueError(f"options: {own[0]} is set by another key of this file")
        SynthOptions().restored(self.options)
        if any(name.partition(":")[0] == "manual" for name in self.models):
            raise ValueError("manual: works for one run, not for a campaign")
        try:
            paid = sorted(n for n in self.models if needs_limit(n, self.base_url))
        except ProviderError as error:
            raise ValueError(str(error)) from None
        if paid and self.max_cost is None and self.max_tokens is None:
            raise ValueError(
                f"max_cost: required for {paid[0]}: a limit in USD for all runs"
            )
        return self

    @property
    def models(self) -> tuple[str, ...]:
        """Names of all learners and optimizers, without duplicates."""
        others = [name for name in self.optimizers if name != SAME]
        return tuple(dict.fromkeys([*self.learners, *others]))


def find_config(name: str) -> Path:
    """Finds a campaign file by its path, or a shipped one by its name.

    Raises:
        CampaignError: There is no such file.
    """
    if Path(name).is_file():
        return Path(name)
    own = shipped(f"{name}.yaml")
    if "/" not in name and own.is_file():
        return own
    known = ", ".join(name.removesuffix(".yaml") for name in shipped_names("*.yaml"))
    raise CampaignError(f"no campaign {name!r}: expected a YAML file, or {known}")


def read_config(file: Path) -> CampaignConfig:
    """Reads a campaign file.

    Raises:
        CampaignError: It cannot be read, or has a wrong or unknown key.
    """
    return read_yaml(file, CampaignConfig, "the campaign", CampaignError)


def required_permissions(
    config: CampaignConfig, base: Path, tasks: Iterable[Task]
) -> Iterator[Wish]:
    """Yields each permission that the user must grant; none for a shipped file.

    Vendors' models need none: `max_cost` or `max_tokens` bounds what they cost.

    Args:
        config: Contents of the campaign file.
        base: Folder of the campaign file.
        tasks: Tasks of the campaign.
    """
    if base.resolve() == shipped("offline.yaml").parent.resolve():
        return
    for name in config.models:
        if name.startswith("command:"):
            yield Wish(asking("model", name))
    if config.base_url is not None:
        yield Wish(f"send its questions, with your key, to {config.base_url}")
    for name in config.prompts:
        if not is_shipped(name):
            template = base / name
            digest = sha256_of_file(template) if template.is_file() else ""
            yield Wish(f"fill in the template {template}", (), digest)
    for task in tasks:
        if task.suite is not None and not task.trusted:
            yield replace(suite_wish(task.suite), flag=())
