"""Options of a synthesis with the defaults that depend on the search."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tdac_agent.prompting.facts import with_omitted
from tdac_agent.synthesis.options import PAPER, RACE, SEARCHES, USUAL, SynthOptions
from tdac_agent.synthesis.question_kinds import KINDS
from tdac_envs.core.arguments import one_of


def settled(options: SynthOptions, *, on_set: bool) -> SynthOptions:
    """The same, with a search and the defaults that depend on it.

    On a set, a prompt that is made of facts is named with those that it omits.

    Args:
        options: The options as given.
        on_set: Whether the problem is a task set.

    Raises:
        TaskError: There is no such search, no such kind of question, or a fact cannot
            be omitted.
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
    if on_set:
        prompt = None if options.prompt == "full" else options.prompt
        facts = with_omitted(prompt, options.omit)
        if facts is not None:
            missing |= {"prompt": facts.name, "omit": ",".join(facts.omitted)}
    return replace(options, search=search, ask=",".join(kinds), **missing)


def kinds_of(ask: str) -> tuple[str, ...]:
    """Kinds of questions, as given with `--ask`."""
    return tuple(dict.fromkeys(filter(None, map(str.strip, ask.split(",")))))
