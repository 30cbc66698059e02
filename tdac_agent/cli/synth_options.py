"""Options of a synthesis, on a task or a task set alike."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.cli.options import (
    BUDGET,
    MODELS,
    key_over_http_option,
    seed_option,
    tier_option,
)
from tdac_agent.cli.task_flags import SETS
from tdac_agent.options import option


@dataclass(frozen=True, slots=True)
class SynthOptions:
    """What a synthesis may do: its loop, its models and its limits."""

    start_from: Path | None = option(
        None, "Controller to begin with.", "--from", metavar="FILE"
    )
    iterations: int = option(20, "Maximum iterations.", "-K", "--iterations", least=1)
    patience: int = option(
        1, "Maximum edits per iteration.", "-J", "--patience", least=0
    )
    candidates: int = option(
        1,
        "Number of new controllers to request at the same time; the best one is "
        "repaired. Each counts as an iteration.",
        "-N",
        "--candidates",
        least=1,
    )
    improve: int = option(
        0,
        "After a success, try variations of the controllers that work, in N further "
        "simulated episodes (disturbed ones on a task), and deliver the best.",
        least=32,
    )
    prompt: str = option(
        "full", "Prompt template: `full`, `underspecified`, or a file.", metavar="NAME"
    )
    refine: bool = option(
        True,
        "Turn failures into rules in the prompt, or keep the prompt as it is.",
        "--refine/--no-refine",
    )
    rules: Path | None = option(
        None,
        "Rules for the prompt: of earlier runs (`tdac rules export`), or your own.",
        metavar="FILE",
    )
    vision: bool = option(
        False, "Show the optimizer a picture of the failure that it is to repair."
    )
    seed: int | None = seed_option()
    tier: str = tier_option()
    learner: str = option(
        "builtin",
        "Model that writes controllers: `builtin` (a template, no language model), "
        "`anthropic:MODEL`, `openai:MODEL`, `command:PROGRAM`, `manual:DIR`, "
        "`replay:RUN` or `scripted:SCRIPT`.",
        metavar="MODEL",
        panel=MODELS,
    )
    optimizer: str | None = option(
        None,
        "Model that repairs failed controllers and writes rules.  [default: the "
        "learner]",
        metavar="MODEL",
        panel=MODELS,
    )
    base_url: str | None = option(
        None,
        "Server of the `openai:` or `anthropic:` models (vLLM, Ollama, LM Studio, …), "
        "for example http://localhost:8000/v1.",
        metavar="URL",
        panel=MODELS,
    )
    key_over_http: bool = key_over_http_option()
    max_output: int = option(
        16_000,
        "Token limit of an answer, thinking included; doubled after an answer that was "
        "cut off.",
        least=1,
        panel=MODELS,
    )
    max_cost: float | None = option(
        None,
        "Cost limit of the whole run; the worst case of each question is reserved "
        "before it is asked.  [default: 2]",
        least=0,
        metavar="USD",
        panel=BUDGET,
    )
    max_tokens: int | None = option(
        None,
        "Token limit of the whole run, input plus output.  [default: none; 1000000 for "
        "a server with unknown prices]",
        least=0,
        panel=BUDGET,
    )
    episodes: int = option(
        128,
        "Maximum number of simulated episodes of all candidates together: half for "
        "feedback, half for the selection.",
        least=2,
        panel=SETS,
        scope="set",
    )
    feedback_episodes: int = option(
        8,
        "Maximum number of episodes in each test of a candidate.",
        least=1,
        panel=SETS,
        scope="set",
    )
    then_verify: bool = option(
        False,
        "Drive the selected controller, once, on hidden worlds drawn with a new salt; "
        "exit 0 only if a sequential test accepts it.",
        panel=SETS,
        scope="set",
    )
