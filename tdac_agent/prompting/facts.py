"""The facts of a level that the question for a task set tells or withholds.

`tdac_agent/prompting/facts/README.md` lists what each fact says. A prompt is named
`facts` (the first wording), `facts-2` (the second one) or `facts:omit=axle,radius`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

FACTS = (
    *("turning", "axes", "units", "radius", "speed", "axle", "rays", "range"),
    *("tolerance", "disturbances", "budget", "worlds", "score"),
)
"""Their names, in the order of the question."""
WORDINGS = {"facts": 1, "facts-2": 2}
"""The wordings, by the name of the prompt."""
_OMIT = ":omit="


@dataclass(frozen=True, slots=True)
class FactsPrompt:
    """A question that is made of facts.

    Attributes:
        kind: A name in `WORDINGS`.
        omitted: Facts that it withholds, in the order of `FACTS`.
    """

    kind: str
    omitted: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its name, from which `facts_prompt` makes it again."""
        return self.kind + (_OMIT + ",".join(self.omitted) if self.omitted else "")

    @property
    def wording(self) -> int:
        """Its wording, 1 or 2."""
        return WORDINGS[self.kind]

    @property
    def told(self) -> tuple[str, ...]:
        """The facts that it tells."""
        return tuple(each for each in FACTS if each not in self.omitted)


def facts_prompt(name: str) -> FactsPrompt | None:
    """The prompt of this name; None if it is none that is made of facts.

    Raises:
        TaskError: It omits an unknown fact.
    """
    kind, _, omitted = name.partition(_OMIT)
    return FactsPrompt(kind, fact_names(omitted)) if kind in WORDINGS else None


def fact_names(listed: str) -> tuple[str, ...]:
    """The facts in a list with commas, in the order of `FACTS`.

    Raises:
        TaskError: One of them is unknown.
    """
    # Slow to import, and the help of the command needs the list alone.
    from tdac_envs.core.errors import TaskError, hint

    found = set(filter(None, map(str.strip, listed.split(","))))
    for name in sorted(found - set(FACTS)):
        raise TaskError(
            f"omit: there is no fact {name!r}{hint(name, FACTS)}; the facts are "
            f"{', '.join(FACTS)}"
        )
    return tuple(each for each in FACTS if each in found)


def with_omitted(prompt: str | None, omit: str) -> FactsPrompt | None:
    """The prompt of a task set that withholds further facts.

    Args:
        prompt: Its name, or a template file; None stands for `facts` if facts are
            omitted.
        omit: Facts, separated by commas.

    Returns:
        The prompt; None if it is not made of facts, and nothing is to be omitted.

    Raises:
        TaskError: A fact is unknown, or the prompt is another one.
    """
    further = fact_names(omit)
    from tdac_envs.core.errors import TaskError

    prompt = prompt or ("facts" if further else "")
    found = facts_prompt(prompt)
    if found is not None:
        return FactsPrompt(found.kind, fact_names(",".join(found.omitted + further)))
    if further:
        raise TaskError(
            f"omit: the prompt {prompt!r} is not made of facts; give --prompt "
            f"{' or '.join(WORDINGS)}, or leave out --omit"
        )
    return None


def is_told(needed: Iterable[str], told: Iterable[str]) -> bool:
    """Whether all the facts that something belongs to are told."""
    return set(needed) <= set(told)
