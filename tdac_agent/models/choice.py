"""Resolve a string such as `anthropic:MODEL` to a provider."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from tdac_agent.errors import ProviderError
from tdac_agent.models.provider import Provider, missing_for
from tdac_agent.models.vendors import VENDORS, forms, vendor_of
from tdac_agent.tasks.setting import Setting
from tdac_envs.core.errors import hint

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

GROUP = "tdac.providers"
# A provider and the packages it needs are imported only when it is chosen.
OWN = {
    "builtin": "tdac_agent.builtin.provider:make_builtin",
    "command": "tdac_agent.models.command:make",
    "manual": "tdac_agent.models.manual:make",
    "replay": "tdac_agent.runs.replay:make",
    "scripted": "tdac_agent.builtin.scripted:make",
}
"""Providers that are no vendors; those are in `VENDORS`."""
OF_VENDORS = "tdac_agent.models.vendor_model:make_model"
OTHER_FORMS = "command:PROGRAM, manual:DIR, replay:RUN, scripted:SCRIPT"
OFFLINE = frozenset({"builtin", "command", "manual", "replay", "scripted"})
IN_FILES = frozenset({"replay", "scripted"})
"""Providers whose answers are all stored in files."""

MEANT = {
    r"(?:openai/)?((?:gpt-|chatgpt-|o\d).*)": "openai:{}",
    r"(?:anthropic/)?(claude-.*)": "anthropic:{}",
    r"(?:(?:google|gemini)[:/])?(gemini-.*)": "openai:{} --base-url "
    "https://generativelanguage.googleapis.com/v1beta/openai/",
    r"ollama[:/](.+)": "openai:{} --base-url http://localhost:11434/v1",
    r"(?:vllm|hosted_vllm)[:/](.+)": "openai:{} --base-url http://localhost:8000/v1",
    r"llama\.?cpp[:/](.+)": "openai:{} --base-url http://localhost:8080/v1",
    r"lm_?studio[:/](.+)": "openai:{} --base-url http://localhost:1234/v1",
}
"""Names of other programs, as patterns with the model's name as a group, and what they
are here. The servers' ports are the defaults of these programs."""

WITHOUT_TASK = frozenset({"command", "replay"})
"""Providers, besides vendors, that can be made before the task is known, without side
effects."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options for making a provider, besides the text after the colon.

    Attributes:
        setting: Setting of the task, for providers that know the environments, or the
            task set if the controller is for one. None if no task is loaded yet, for
            providers that need none (`needs_task`).
        base_url: URL of the models' server; None for the default.
        key_over_http: Whether a key may go to another machine unencrypted.
    """

    setting: Setting | TaskSet | None
    base_url: str | None = None
    key_over_http: bool = False


Make = Callable[[str, Options], Provider]
"""Entry point of the group `tdac.providers`: takes the text after the colon and the
options, and returns a provider or raises `ProviderError`."""


def choose_models(
    learner: str | Provider,
    optimizer: str | Provider | None,
    setting: Setting | TaskSet,
    base_url: str | None = None,
    *,
    key_over_http: bool = False,
) -> tuple[Provider, Provider]:
    """Returns the Learner and the Optimizer; one object if both have the same name.

    Args:
        learner: A provider or its name.
        optimizer: A provider or its name; None for the learner.
        setting: Setting of the task, or the task set.
        base_url: URL of the models' server.
        key_over_http: As in `Options`.

    Raises:
        ProviderError: A name is unknown, or cannot be used.
    """
    named = [name for name in (learner, optimizer) if isinstance(name, str)]
    check_names(named, base_url)
    options = Options(setting, base_url, key_over_http)
    first = choose_model(learner, options) if isinstance(learner, str) else learner
    if optimizer is None or optimizer == learner:
        return first, first
    if isinstance(optimizer, str):
        return first, choose_model(optimizer, options)
    return first, optimizer


def choose_model(name: str, options: Options) -> Provider:
    """Returns the provider for a name such as `anthropic:MODEL`.

    Its key or package may still be missing; see `missing_for`.

    Raises:
        ProviderError: The name is unknown, or cannot be used.
    """
    kind, _, words = name.partition(":")
    make = _own(name)
    if make is None:
        check_name(name)
        others = {point.name: point for point in entry_points(group=GROUP)}
        make = _load(others[kind])
    return make(words, options)


def needs_task(name: str) -> bool:
    """Whether a provider cannot be made, without side effects, before a task is known.

    Args:
        name: Name of the model.
    """
    return vendor_of(name) is None and name.partition(":")[0] not in WITHOUT_TASK


def _own(name: str) -> Make | None:
    """What makes a provider of tdac; None for the name of another one."""
    vendor, kind = vendor_of(name), name.partition(":")[0]
    if vendor is not None:
        return partial(resolve_name(OF_VENDORS), vendor)
    make: Make | None = resolve_name(OWN[kind]) if kind in OWN else None
    return make


def missing_for_name(name: str, options: Options) -> tuple[str, ...]:
    """Returns what a run with a model still needs; creates no folder, asks no model.

    Raises:
        ProviderError: The name is unknown, or no run can start with it.
    """
    check_name(name)
    kind, _, words = name.partition(":")
    # Making a third-party provider may need its key; `manual` would create its folder.
    if kind not in {*OWN, *VENDORS} or (kind == "manual" and words):
        return ()
    return missing_for(choose_model(name, options))


def answers_sha256(name: str, options: Options) -> str | None:
    """Returns the hash of a model's possible answers; None if they are not in files.

    Raises:
        ProviderError: The files cannot be used.
    """
    if name.partition(":")[0] not in IN_FILES:
        return None
    model: Any = choose_model(name, options)
    return str(model.answers_sha256())


def check_names(names: Sequence[str], base_url: str | None) -> None:
    """Checks that providers with these names exist, and can have this base URL.

    Raises:
        ProviderError: A name is unknown, or the URL cannot be used.
    """
    for name in names:
        check_name(name)
    if base_url is not None and names:  # provider objects have their own
        _check_url(base_url, names)


def check_name(name: str) -> None:
    """Checks that a provider with this name exists, without making it or reading a key.

    Raises:
        ProviderError: The name is unknown; the message lists the known forms.
    """
    kind = name.partition(":")[0]
    others = {point.name for point in entry_points(group=GROUP)}
    if kind in {*OWN, *VENDORS, *others}:
        return
    meant = _meant(name) or hint(kind, [*OWN, *VENDORS, *others])
    known = ", ".join(
        ["builtin", *forms(), OTHER_FORMS, *(f"{other}:…" for other in sorted(others))]
    )
    raise ProviderError(f"unknown model {name!r}{meant}; known: {known}")


def _meant(name: str) -> str:
    """What a name without a provider, or with another program's name, stands for."""
    for pattern, form in MEANT.items():
        match = re.fullmatch(pattern, name)
        if match:
            return f" (did you mean {form.format(match[1])}?)"
    return ""


def _load(point: EntryPoint) -> Make:
    try:
        make: Make = point.load()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise ProviderError(
            f"the provider {point.name!r} ({point.value}) cannot be loaded: {reason}"
        ) from error
    return make


def _check_url(url: str, named: Sequence[str]) -> None:
    """Raises ProviderError unless a URL is valid, secret-free and for one vendor."""
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"http", "https"} and bool(parts.hostname)
        secret = parts.username is not None or bool(parts.query)
    except ValueError:
        usable = secret = False
    if secret:
        raise ProviderError(
            "--base-url must have no user, password or query: it is stored with the run"
        )
    if not usable:
        raise ProviderError(
            f"--base-url {url!r} is not a valid URL; "
            "expected one like http://localhost:8000/v1"
        )
    kinds = {name.partition(":")[0] for name in named} - OFFLINE
    if not kinds:
        raise ProviderError(
            f"--base-url is for {' and '.join(forms())}; no such model is used"
        )
    if len(kinds) > 1:
        asked = sorted(kinds & {*VENDORS} or VENDORS)
        variables = [VENDORS[kind].base_url for kind in asked]
        raise ProviderError(
            f"--base-url cannot be used for {' and '.join(sorted(kinds))} at once; set "
            f"{' or '.join(variables)} for one of them"
        )
