"""The command `tdac synth`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.mistakes import begun
from tdac_agent.cli.options import (
    BaseUrl,
    JitterSeed,
    Json,
    KeyOverHttp,
    Learner,
    MaxCost,
    MaxOutput,
    MaxTokens,
    Optimizer,
    Profile,
    Suite,
    Tier,
    Trust,
    dir_flag,
    file_flag,
    number_flag,
)
from tdac_agent.cli.task_flags import NamedTask, takes_task

app = typer.Typer()
SETS = "Task set"
ALLOWED = (
    *("learner", "optimizer", "base_url", "key_over_http"),
    *("prompt", "suite", "seed"),
)
"""Flags that, given with --resume, permit a run from elsewhere to use their values."""
WITH_RESUME = frozenset(
    {
        *("resume", "max_cost", "max_tokens", "tier", "as_json", "trust"),
        "then_verify",
        *ALLOWED,
    }
)


@app.command(
    epilog="Examples: `tdac synth`; `tdac synth --map plan.png --start 90 302 "
    "--goal 178 386 --robot-radius 12`; "
    "`tdac synth --learner anthropic:claude-sonnet-5-5`; "
    "`tdac synth --set known`; `tdac synth --resume runs/maze-1`"
)
@takes_task(without=())
def synth(
    context: typer.Context,
    named_task: NamedTask,
    profile: Profile = None,
    from_: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag("--from", help="Controller to begin with."),
    ] = None,
    k: Annotated[
        int, number_flag("-K", "--iterations", min=1, help="Maximum iterations.")
    ] = 20,
    j: Annotated[
        int, number_flag("-J", "--patience", min=0, help="Maximum edits per iteration.")
    ] = 1,
    candidates: Annotated[
        int,
        number_flag(
            "-N",
            "--candidates",
            min=1,
            help="Number of new controllers to request at the same time; the best one "
            "is repaired. Each counts as an iteration.",
        ),
    ] = 1,
    improve: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=32,
            help="After a success, try variations of the controllers that work, in N "
            "further simulated episodes (disturbed ones on a task), and deliver the "
            "best.",
        ),
    ] = None,
    suite: Suite = None,
    learner: Learner = "builtin",
    optimizer: Optimizer = None,
    base_url: BaseUrl = None,
    key_over_http: KeyOverHttp = False,
    max_output: MaxOutput = None,
    max_cost: MaxCost = None,
    max_tokens: MaxTokens = None,
    prompt: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Prompt template: `full`, `underspecified`, or a file."
        ),
    ] = "full",
    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--no-refine",
            help="Turn failures into rules in the prompt, or keep the prompt as it is.",
        ),
    ] = True,
    rules: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(
            "--rules",
            help="Rules for the prompt: of earlier runs (`tdac rules export`), or your "
            "own.",
        ),
    ] = None,
    vision: Annotated[
        bool,
        typer.Option(
            "--vision",
            help="Show the optimizer a picture of the failure that it is to repair.",
        ),
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Print the first prompt and the maximum cost; ask no model.",
        ),
    ] = False,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--out",
            help="Run folder; an unfinished run of the same command in it is continued."
            "  [default: runs/TASK-N]",
        ),
    ] = None,
    resume: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--resume", help="Continue the run in this folder with its own settings."
        ),
    ] = None,
    seed: JitterSeed = None,
    tier: Tier = "auto",
    trust: Trust = False,
    as_json: Json = False,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml: write a controller for worlds "
            "that it has never seen, and select the best one on worlds of dev.",
            rich_help_panel=SETS,
        ),
    ] = None,
    episodes: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=2,
            help="Maximum number of simulated episodes of all candidates together: "
            "half for feedback, half for the selection.  [default: 128]",
            rich_help_panel=SETS,
        ),
    ] = None,
    feedback_episodes: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="Maximum number of episodes in each test of a candidate.  "
            "[default: 8]",
            rich_help_panel=SETS,
        ),
    ] = None,
    then_verify: Annotated[
        bool,
        typer.Option(
            "--then-verify",
            help="Drive the selected controller, once, on hidden worlds drawn with a "
            "new salt; exit 0 only if a sequential test accepts it.",
            rich_help_panel=SETS,
        ),
    ] = False,
) -> None:
    """Write, test and repair a controller until it is verified."""
    with begun():
        from tdac_agent.cli import synth as command
    from tdac_agent.cli.synth_set_flags import SynthSetFlags
    from tdac_agent.models.provider import MAX_OUTPUT_TOKENS

    limits = {"max_cost": max_cost, "max_tokens": max_tokens}
    if resume is not None:
        _refuse_others(context)
        given = {name: context.params[name] for name in ALLOWED}
        given = {
            name: value for name, value in given.items() if _is_typed(context, name)
        }
        settings = {**limits, "tier": tier}
        code = command.resume(resume, given, settings, trust, as_json, then_verify)
        raise typer.Exit(code)
    from tdac_agent.prompting.given_rules import read_given

    models = {
        "learner": learner,
        "optimizer": optimizer,
        "base_url": base_url,
        "key_over_http": key_over_http,
        "prompt": prompt,
        "max_output": MAX_OUTPUT_TOKENS if max_output is None else max_output,
        "rules": None if rules is None else read_given(rules),
    }
    loop = {
        "iterations": k,
        "patience": j,
        "candidates": candidates,
        "refine": refine,
        "vision": vision,
        "improve": improve or 0,
    }
    on_set = SynthSetFlags(set_name, episodes, feedback_episodes, then_verify)
    if on_set != SynthSetFlags():
        from tdac_agent.cli import synth_set

        others = {"--profile": profile, "--suite": suite, "--trust": trust}
        on_set.check(named_task(), others)
        if dry_run:
            terms = {**models, **limits}
            raise typer.Exit(synth_set.dry_run(on_set, terms, loop, as_json))
        wanted = {**models, **limits, **loop, "seed": seed, "tier": tier}
        raise typer.Exit(synth_set.run(on_set, wanted, out, from_, as_json))
    if dry_run:
        from tdac_agent.cli import dry_run as dry

        terms = {**models, **limits}
        raise typer.Exit(dry.run(named_task(), profile, terms, loop, as_json))
    wanted = {**models, **limits, **loop, "seed": seed, "tier": tier}
    raise typer.Exit(
        command.run(named_task(), profile, wanted, out, from_, suite, trust, as_json)
    )


def _refuse_others(context: typer.Context) -> None:
    """Refuses flags whose values --resume takes from the run folder.

    Raises:
        RunError: Such a flag is given; the message names it.
    """
    from tdac_agent.errors import RunError

    others = [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name not in WITH_RESUME and _is_typed(context, str(parameter.name))
    ]
    if others:
        names = ", ".join(others)
        raise RunError(f"--resume continues a run as it was begun: leave out {names}")


def _is_typed(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
