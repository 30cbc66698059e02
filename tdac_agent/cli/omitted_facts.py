"""`tdac synth --omit`: the prompt that withholds the facts."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from tdac_agent.prompting.facts import with_omitted
from tdac_agent.synthesis.options import SynthOptions


def with_facts(
    options: SynthOptions, typed: Collection[str], *, on_set: bool
) -> SynthOptions:
    """The options with a prompt whose name carries the facts that it withholds.

    Args:
        options: Options of the synthesis.
        typed: Names of the flags on the command line.
        on_set: Whether a controller for a task set is to be written.

    Raises:
        TaskError: A fact is unknown, or the prompt is not made of facts.
    """
    if not on_set:
        return options
    chosen = options.prompt if "prompt" in typed else None
    facts = with_omitted(chosen, options.omit)
    if facts is None:
        return options
    return replace(options, prompt=facts.name, omit=",".join(facts.omitted))
