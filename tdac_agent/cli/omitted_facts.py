"""`tdac synth --omit`: which prompts can withhold facts."""

from __future__ import annotations

from collections.abc import Collection

from tdac_agent.prompting.facts import with_omitted
from tdac_agent.synthesis.options import SynthOptions


def check_omitted(
    options: SynthOptions, typed: Collection[str], *, on_set: bool
) -> None:
    """Refuses `--omit` beside `--prompt full`, which otherwise stands for no choice.

    Args:
        options: Options of the synthesis.
        typed: Names of the flags on the command line.
        on_set: Whether a controller for a task set is to be written.

    Raises:
        TaskError: A fact is unknown, or the prompt is not made of facts.
    """
    if on_set and "prompt" in typed:
        with_omitted(options.prompt, options.omit)
