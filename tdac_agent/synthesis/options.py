"""The options of a synthesis: flags of `tdac synth`, and keywords of `synthesize`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from tdac_agent.models.vendors import forms
from tdac_agent.option_fields import Flag, flag_of, option
from tdac_agent.prompting.facts import FACTS
from tdac_agent.synthesis.question_kinds import ASKED, KINDS

if TYPE_CHECKING:
    from tdac_agent.models.provider import Provider
    from tdac_agent.prompting.rules import RuleBook

MODELS, BUDGET, SETS = "Models", "Budget", "Task set"
"""Headings of the help."""
Engine = Literal["exact", "mujoco", "mujoco-varied", "mujoco-rays"]
"""What can move the robot, as `tdac_envs.physics.moved.ENGINES`."""
ENGINES = "|".join(get_args(Engine))
SUITE = "Folder with additional test_*.py files to run."
PAPER, RACE = SEARCHES = "paper", "race"
USUAL = {
    PAPER: {"iterations": 20, "candidates": 1, "episodes": 128},
    RACE: {"iterations": 8, "candidates": 4, "episodes": 512},
}
"""Defaults that depend on the search."""


@dataclass(frozen=True, slots=True)
class SynthOptions:
    """How a controller is written; see `tdac synth --help`.

    `learner` and `optimizer` may also be providers, `rules` a rule book, and
    `start_from` the source of a controller.

    A field is a flag and an argument of `synthesize`. The loop has it as
    `Terms.options` and `Calls.options`. The record of a run keeps it, `--resume` uses
    the recorded value or a new one, and a campaign file can set it, unless the field
    says otherwise (`Flag.identity`, `Flag.recorded`).
    """

    search: str | None = option(
        None,
        "`paper`: repair the latest controller, as Algorithm 2 of the paper. `race`: "
        "first answers drive in the same episodes, then further questions build on "
        "the best ones.  [default: paper on a task, race on a task set]",
        metavar="NAME",
        identity=True,
    )
    iterations: int | None = option(
        None,
        "Maximum iterations; in a race, all answers.  [default: 20; 8 in a race]",
        *("-K", "--iterations"),
        least=1,
        identity=True,
    )
    patience: int = option(
        1, "Maximum edits per iteration.", "-J", "--patience", least=0, identity=True
    )
    candidates: int | None = option(
        None,
        "Number of new controllers to request at the same time; the best one is "
        "repaired. Each counts as an iteration. In a race, the first answers.  "
        "[default: 1; 4 in a race]",
        *("-N", "--candidates"),
        least=1,
        identity=True,
    )
    improve: int = option(
        0,
        "After a success, try variations of the controllers that work, in N further "
        "simulated episodes (disturbed ones on a task), and deliver the best.",
        least=32,
        identity=True,
    )
    ask: str = option(
        ",".join(ASKED),
        "Kinds of questions of a race after the first answers, separated by commas: "
        f"{', '.join(f'`{kind}`' for kind in KINDS)}.",
        metavar="KINDS",
        identity=True,
    )
    envelope: int = option(
        0,
        "At the end, search for the smallest deviation with which the controller "
        "fails, with at most E episodes; see tdac falsify. A race also searches for "
        "that of each candidate that is the best one, and tells it in its questions; "
        "these episodes come on top.",
        metavar="E",
        least=16,
        identity=True,
    )
    start_from: str | Path | None = option(
        None,
        "Controller to begin with.",
        "--from",
        metavar="FILE",
        type=Path,
        identity=True,
        recorded=False,
    )
    prompt: str = option(
        "full",
        "Prompt template: `full`, `underspecified`, `facts` or `facts-2` (on a task "
        "set), or a file.",
        metavar="NAME",
        recorded=False,
    )
    omit: str = option(
        "",
        "Facts that the question withholds, separated by commas, with the prompt "
        f"`facts` or `facts-2`: {', '.join(f'`{fact}`' for fact in FACTS)}.  [default: "
        "none; without --prompt, `facts` if facts are omitted]",
        metavar="FACTS",
        panel=SETS,
        scope="set",
        identity=True,
    )
    refine: bool = option(
        True,
        "Turn failures into rules in the prompt, or keep the prompt as it is.",
        "--refine/--no-refine",
        identity=True,
    )
    rules: Path | RuleBook | None = option(
        None,
        "Rules for the prompt: of earlier runs (`tdac rules export`), or your own.",
        metavar="FILE",
        type=Path,
        identity=True,
        recorded=False,
    )
    suite: Path | None = option(None, SUITE, metavar="DIR", recorded=False)
    confirm: bool = option(
        True,
        "Drive what passes all tests blind, from about a hundred disturbed starts; a "
        "controller is verified if at most one of these drives fails. Without it, the "
        "run ends at `passed`.",
        "--confirm/--no-confirm",
        scope="task",
    )
    physics: Engine = option(
        "exact",
        "Another physics that drives what arrives again, for a second opinion in the "
        "report (extra `physics`); exact for none. mujoco-varied varies mass, "
        "friction, axle and wheels a little; mujoco-rays also measures the rays.",
        metavar=ENGINES,
        scope="task",
        recorded=False,
    )
    seed: int | None = option(
        None,
        "Seed of the jittered starts, or of the choice of worlds on a task set.  "
        "[default: derived from a secret of this installation]",
        least=0,
        recorded=False,
    )
    tier: str = option(
        "auto",
        "Sandbox tier; `tdac doctor` lists them.",
        metavar="NAME",
        recorded=False,
    )
    learner: str | Provider = option(
        "builtin",
        "Model that writes controllers: `builtin` (a template, no language model), "
        f"{', '.join(forms(mark='`'))}, `command:PROGRAM`, `manual:DIR`, `replay:RUN` "
        "or `scripted:SCRIPT`.",
        metavar="MODEL",
        panel=MODELS,
        type=str,
        recorded=False,
    )
    optimizer: str | Provider | None = option(
        None,
        "Model that repairs failed controllers and writes rules.  [default: the "
        "learner]",
        metavar="MODEL",
        panel=MODELS,
        type=str,
        recorded=False,
    )
    base_url: str | None = option(
        None,
        "Server of the models, instead of the vendor's (vLLM, Ollama, LM Studio, …), "
        "for example http://localhost:8000/v1.",
        metavar="URL",
        panel=MODELS,
    )
    key_over_http: bool = option(
        False,
        "Allow sending an API key unencrypted to a server on another machine.",
        panel=MODELS,
        recorded=False,
    )
    max_output: int = option(
        16_000,
        "Token limit of an answer, thinking included; doubled after an answer that "
        "was cut off.",
        least=1,
        panel=MODELS,
        identity=True,
    )
    max_cost: float | None = option(
        None,
        "Cost limit of the whole run; the worst case of each question is reserved "
        "before it is asked.  [default: 2]",
        least=0,
        metavar="USD",
        panel=BUDGET,
        recorded=False,
    )
    max_tokens: int | None = option(
        None,
        "Token limit of the whole run, input plus output.  [default: none; 1000000 "
        "for a server with unknown prices]",
        least=0,
        panel=BUDGET,
        recorded=False,
    )
    episodes: int | None = option(
        None,
        "Maximum number of simulated episodes of all candidates together: half for "
        "feedback, half for the selection. In a race, a quarter of them compares the "
        "selected controller with the best first answer.  [default: 128; 512 in a "
        "race]",
        least=2,
        panel=SETS,
        scope="set",
        identity=True,
    )
    feedback_episodes: int = option(
        8,
        "Maximum number of episodes in each test of a candidate.",
        least=1,
        panel=SETS,
        scope="set",
        identity=True,
    )
    then_verify: bool = option(
        False,
        "Drive the selected controller, once, on hidden worlds drawn with a new salt; "
        "exit 0 only if a sequential test accepts it.",
        panel=SETS,
        scope="set",
        recorded=False,
    )

    def changed(self, **values: Any) -> SynthOptions:
        """The same with other values.

        Raises:
            TypeError: There is no such option.
        """
        known = {each.name for each in fields(self)}
        unknown = [name for name in values if name not in known]
        if unknown:
            raise TypeError(
                f"synthesize has no option {unknown[0]!r}; the options are "
                f"{', '.join(sorted(known))}"
            )
        return replace(self, **values)

    def recorded(self, scope: str) -> dict[str, Any]:
        """The values that the record of a run keeps, by name.

        Args:
            scope: `task` or `set`, for a run on a single task or a task set.
        """
        return {
            field.name: getattr(self, field.name)
            for field, flag in _flags(self)
            if flag.recorded and flag.scope in {"", scope}
        }

    @property
    def identity(self) -> dict[str, Any]:
        """The options in which equal runs agree, with their defaults."""
        return {
            field.name: field.default for field, flag in _flags(self) if flag.identity
        }

    @property
    def least(self) -> dict[str, int]:
        """The least value of each whole number whose value is not its default."""
        return {
            field.name: int(flag.least)
            for field, flag in _flags(self)
            if type(field.default) is int or field.name in USUAL[PAPER]
            if flag.least is not None
            if getattr(self, field.name) is not field.default
        }

    def as_typed(self, scope: str) -> SynthOptions:
        """The same without the values that its search has anyway, for a command line.

        Args:
            scope: `task` or `set`, which decides on the usual search.
        """
        usual = RACE if scope == "set" else PAPER
        own = USUAL.get(self.search or usual, {}) | {"search": usual}
        same = [name for name in own if getattr(self, name) == own[name]]
        return self.changed(**dict.fromkeys(same))

    def restored(self, values: Mapping[str, Any]) -> SynthOptions:
        """The same with recorded values, or with those of a file.

        Raises:
            ValueError: An option is unknown, not one that is recorded, or its value is
                too small or of another type.
        """
        known = {f.name: (f, flag) for f, flag in _flags(self) if flag.recorded}
        for name, value in values.items():
            if name not in known:
                text = ", ".join(sorted(known))
                raise ValueError(f"there is no option {name!r}; expected one of {text}")
            field, flag = known[name]
            usual = USUAL[PAPER].get(name, field.default)
            kind, least = type(usual), flag.least
            if usual is not None and type(value) is not kind:
                raise ValueError(f"{name}: expected {kind.__name__}, got {value!r}")
            if least is not None and value != field.default and value < least:
                raise ValueError(f"{name}: expected at least {least:g}, got {value!r}")
        return replace(self, **values)


def _flags(options: SynthOptions) -> list[tuple[Field[Any], Flag]]:
    """The fields of options with their flags."""
    pairs = [(field, flag_of(field)) for field in fields(options)]
    return [(field, flag) for field, flag in pairs if flag is not None]
