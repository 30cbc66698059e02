"""From a string such as `anthropic:MODEL` to the provider that it names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pkgutil import resolve_name
from typing import Any
from urllib.parse import urlsplit

from tdac_agent.errors import ProviderError
from tdac_agent.models.provider import Provider, missing_for
from tdac_agent.tasks.setting import Setting
from tdac_envs.core.errors import hint

GROUP = "tdac.providers"
# Each is imported only when it is chosen: so are the packages that it needs.
OWN = {
    "builtin": "tdac_agent.builtin.provider:make_builtin",
    "anthropic": "tdac_agent.models.anthropic_api:make",
    "openai": "tdac_agent.models.openai_api:make",
    "command": "tdac_agent.models.command:make",
    "manual": "tdac_agent.models.manual:make",
    "replay": "tdac_agent.runs.replay:make",
    "scripted": "tdac_agent.builtin.scripted:make",
}
FORMS = (
    "builtin, anthropic:MODEL, openai:MODEL, command:PROGRAM, manual:DIR, replay:RUN, "
    "scripted:SCRIPT"
)
OFFLINE = frozenset({"builtin", "command", "manual", "replay", "scripted"})
IN_FILES = frozenset({"replay", "scripted"})
"""Those whose answers are all known beforehand."""


@dataclass(frozen=True, slots=True)
class Options:
    """What a provider may need besides its own words.

    Attributes:
        setting: The task's, for providers that know the environments.
        base_url: Where its models are served, if not where they usually are.
        key_over_http: Whether a key may go to another machine unencrypted.
    """

    setting: Setting
    base_url: str | None = None
    key_over_http: bool = False


Make = Callable[[str, Options], Provider]
"""What an entry point of the group `tdac.providers` is: the words after the colon and
the options in, a provider out; it raises `ProviderError` where that is not possible."""


def choose_models(
    learner: str | Provider,
    optimizer: str | Provider | None,
    setting: Setting,
    base_url: str | None = None,
    *,
    key_over_http: bool = False,
) -> tuple[Provider, Provider]:
    """The Learner and the Optimizer; one and the same where they are named so.

    Args:
        learner: A provider, or its name.
        optimizer: The same; None for the learner.
        setting: The task's.
        base_url: Of the models that are served somewhere.
        key_over_http: As for `Options`.

    Raises:
        ProviderError: A name is unknown, or cannot be used.
    """
    named = [name for name in (learner, optimizer) if isinstance(name, str)]
    if base_url is not None and named:  # others have been made with theirs
        _check_url(base_url, named)
    options = Options(setting, base_url, key_over_http)
    first = choose_model(learner, options) if isinstance(learner, str) else learner
    if optimizer is None or optimizer == learner:
        return first, first
    if isinstance(optimizer, str):
        return first, choose_model(optimizer, options)
    return first, optimizer


def choose_model(name: str, options: Options) -> Provider:
    """The provider that a name such as `anthropic:MODEL` stands for.

    What it may lack before it can be asked is for `missing_for`.

    Raises:
        ProviderError: The name is unknown, or cannot be used.
    """
    kind, _, words = name.partition(":")
    if kind in OWN:
        make: Make = resolve_name(OWN[kind])
        return make(words, options)
    check_name(name)
    others = {point.name: point for point in entry_points(group=GROUP)}
    return _load(others[kind])(words, options)


def missing_before(name: str, options: Options) -> tuple[str, ...]:
    """What a run with a model would still need; no folder is made, nobody is asked.

    Raises:
        ProviderError: The name is unknown, or no run could begin with it.
    """
    check_name(name)
    kind, _, words = name.partition(":")
    # A provider of others may need its key, and `manual` makes its folder.
    if kind not in OWN or (kind == "manual" and words):
        return ()
    return missing_for(choose_model(name, options))


def answers_sha256(name: str, options: Options) -> str | None:
    """Hash of all that a model may answer, where that is in files; else None.

    Raises:
        ProviderError: The files cannot be used.
    """
    if name.partition(":")[0] not in IN_FILES:
        return None
    model: Any = choose_model(name, options)
    return str(model.answers_sha256())


def check_name(name: str) -> None:
    """Refuses a name that no provider answers to; makes none, and needs no key.

    Raises:
        ProviderError: With the forms that there are.
    """
    kind = name.partition(":")[0]
    others = {point.name for point in entry_points(group=GROUP)}
    if kind in OWN or kind in others:
        return
    meant = hint(kind, [*OWN, *others])
    also = "".join(f", {other}:…" for other in sorted(others))
    raise ProviderError(f"unknown model {name!r}{meant}; known: {FORMS}{also}")


def _load(point: EntryPoint) -> Make:
    try:
        make: Make = point.load()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise ProviderError(
            f"the provider {point.name!r} ({point.value}) cannot be loaded: {reason}"
        ) from error
    return make


def _check_url(url: str, named: list[str]) -> None:
    """Refuses an address that cannot be meant, or may hold a secret.

    Raises:
        ProviderError: With what to do instead.
    """
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"http", "https"} and bool(parts.hostname)
        secret = parts.username is not None or bool(parts.query)
    except ValueError:
        usable = secret = False
    if secret:
        raise ProviderError(
            "the base URL must hold no user, password or query: it is kept with the run"
        )
    if not usable:
        raise ProviderError(
            f"the base URL {url!r} is none; expected one like http://localhost:8000/v1"
        )
    kinds = {name.partition(":")[0] for name in named} - OFFLINE
    if not kinds:
        raise ProviderError(
            "--base-url is for anthropic:MODEL and openai:MODEL; no such model is used"
        )
    if len(kinds) > 1:
        raise ProviderError(
            f"--base-url cannot be for {' and '.join(sorted(kinds))} at once; set "
            "ANTHROPIC_BASE_URL or OPENAI_BASE_URL for one of them"
        )
