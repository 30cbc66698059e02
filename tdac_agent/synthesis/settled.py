"""Options of a synthesis with the defaults that depend on the search."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tdac_agent.synthesis.options import PAPER, RACE, SEARCHES, USUAL, SynthOptions
from tdac_agent.synthesis.question_kinds import KINDS
from tdac_envs.core.arguments import one_of


def settled(options: SynthOptions, *, on_set: bool) -> SynthOptions:
    """The same, with a search and the defaults that depend on it.

    Args:
        options: The options as given.
        on_set: Whether the problem is a task set.

    Raises:
        TaskError: There is no such search, or no such kind of question.
    """
    search = options.search or (RACE if on_set else PAPER)
    one_of("search", search, SEARCHES)
    kinds = kinds_of(options.ask)
    for kind in kinds:
        one_of("ask", kind, KINDS)
    usual = USUAL[search]
    missing: dict[str, Any] = {
        name: usual[name] for name in usual if getattr(options, name) is None
    }
    return replace(options, search=search, ask=",".join(kinds), **missing)


def kinds_of(ask: str) -> tuple[str, ...]:
    """Kinds of questions, as given with `--ask`."""
    return tuple(dict.fromkeys(filter(None, map(str.strip, ask.split(",")))))
