"""Values for the template of one run."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.html_report.animation import animations
from tdac_agent.html_report.envelope import envelope_of
from tdac_agent.html_report.figures import drawn
from tdac_agent.html_report.overview import format_seconds
from tdac_agent.html_report.scene import TaskPicture
from tdac_agent.html_report.set_part import set_part_of
from tdac_agent.html_report.still import MOST_STILLS, still_of
from tdac_agent.html_report.story import story_of
from tdac_agent.models.budget import format_usd
from tdac_agent.option_fields import words_of
from tdac_agent.plots import plot_breakdown
from tdac_agent.runs.history import RunHistory, learner_named
from tdac_agent.runs.improvement_record import read_improvement
from tdac_agent.runs.resume import recorded_settings, resume_line
from tdac_agent.runs.run_record import (
    AGENT,
    GIVEN_FILE,
    GIVEN_RULES_FILE,
    PROMPT_FILE,
    Run,
)
from tdac_agent.runs.selection_record import asked_text
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.tasks.setting import tolerance_text
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.tasks.units import UNITS
from tdac_agent.verification.confirmation import read_confirmation
from tdac_agent.verification.diagnosis.losses import Losses
from tdac_agent.verification.diagnosis.report import Diagnosis, Report
from tdac_envs.ladder.frozen import BEFORE

DIFF_LINES = (100, 600)
ALL_DIFF_LINES = 20_000
NEW_LINES = 40
"""Of a new file; all of it stands below, if it was delivered."""
FEW = 4
"""Runs of a page that are shown with everything."""
MOST_ROWS = 60
"""Limit for the table of failed tests."""


@dataclass(frozen=True, slots=True)
class FailureGroup:
    """Tests that failed with the same message.

    Attributes:
        message: The message: expected and actual result.
        tests: Ids of the tests.
        diagnoses: Diagnoses of their episodes, except those that an earlier entry has.
    """

    message: str
    tests: tuple[str, ...]
    diagnoses: tuple[Diagnosis, ...]


def section_of(
    history: RunHistory,
    number: int,
    name: str,
    scene: tuple[str, TaskPicture] | None,
    runs: int = 1,
) -> dict[str, Any]:
    """Collects the values for the template of a run.

    Args:
        history: The run.
        number: Number of its section in the page, from 1.
        name: Displayed name of its folder.
        scene: Key of its task's scene in the page, and the scene.
        runs: Runs of the page. With more than `FEW`, each is shorter: figures of time
            and coloured code are in the report on the run alone.
    """
    run, report = history.run, history.report
    least, most = DIFF_LINES
    brief = runs > FEW
    share = ALL_DIFF_LINES // max(1, len(history.tried) * runs)
    iterations = itertools.groupby(history.tried, key=lambda one: one.k)
    episodes = []
    if scene is not None and history.task is not None:
        episodes = animations(history, history.task, scene[1], brief=brief)
    return {
        "number": number,
        "name": name,
        "history": history,
        "run": run,
        "learner": learner_named(run.learner),
        "iterations": [(k, list(group)) for k, group in iterations],
        "failures": list(_failures(history)),
        "scene": scene,
        "task_near": _near(history),
        "episodes": episodes,
        "story": story_of(history, episodes),
        "confirmed": read_confirmation(run) if run.confirmations else None,
        "still": still_of(history) if number <= MOST_STILLS else None,
        "watchable": {(e["candidate"], e["name"]): n for n, e in enumerate(episodes)},
        "most_lines": max(least, min(most, share)),
        "most_new": NEW_LINES,
        "brief": brief,
        "breakdown": None if brief else _breakdown(history),
        "seconds": format_seconds(run.seconds),
        "spent": spent(history),
        "origin": _origin(history),
        "commands": list(_commands(history, name)),
        "set_part": set_part_of(history),
        "improvement": read_improvement(run.folder) if run.improve else None,
        "envelope": envelope_of(run.folder),
        "causes": tuple(Losses().by_cause),
        "asked_text": asked_text,
        "units": None if report is None else UNITS[report.provenance.unit],
    }


def _near(history: RunHistory) -> str:
    """Formats the goal tolerance of the run's task; empty without a task."""
    return "" if history.task is None else tolerance_text(history.task.setting)


def _breakdown(history: RunHistory) -> str | None:
    """Figure of time and tokens as a data URL; None if the journal is unusable."""
    if not history.run.attempts:
        return None
    try:
        return drawn(plot_breakdown(history.run))
    except (RunError, KeyError, TypeError, ValueError):
        return None


def grouped_failures(report: Report) -> list[FailureGroup]:
    """Groups the failures of a report by message."""
    by_message: dict[str, list[Any]] = {}
    for failure in report.failures:
        by_message.setdefault(failure.message, []).append(failure)
    seen: set[str] = set()
    rows = []
    for message, failures in by_message.items():
        by_text = {f.diagnosis.text: f.diagnosis for f in failures if f.diagnosis}
        fresh = tuple(by_text[text] for text in by_text if text not in seen)
        seen.update(by_text)
        rows.append(FailureGroup(message, tuple(f.test for f in failures), fresh))
    return rows


def spent(history: RunHistory) -> str:
    """Tokens and cost of a run, as text."""
    run = history.run
    if not run.tokens:
        return "not counted"
    cost = "cost unknown" if run.cost is None else format_usd(run.cost)
    if run.cost_lost:
        cost += f", and at most {format_usd(run.cost_lost)} for lost answers"
    return f"{run.tokens_in:,} in, {run.tokens_out:,} out; {cost}"


def _failures(history: RunHistory) -> Iterator[tuple[str, list[bool]]]:
    """Each test that ever failed, and whether each candidate failed it."""
    names = dict.fromkeys(test for one in history.tried for test in one.failed)
    for name in itertools.islice(names, MOST_ROWS):
        yield name, [name in one.failed for one in history.tried]


def _origin(history: RunHistory) -> list[tuple[str, str]]:
    """Provenance of the run: name and value of each fact."""
    run, report = history.run, history.report
    several = f", {run.candidates} side by side" if run.candidates > 1 else ""
    pictures = "a failure, with each question to edit or improve"
    clients = ", ".join(run.clients) or "none"
    facts = [
        ("started", run.started),
        ("task", f"{run.task}, sha256 {run.task_sha256}"),
        ("dynamics", f"sha256 {run.dynamics}" if run.dynamics else BEFORE),
        ("Learner", learner_named(run.learner)),
        ("Optimizer", learner_named(run.optimizer)),
        ("agent", run.agent),
        ("programs of the agent (as reported)", clients if run.agent else ""),
        ("models (as reported)", ", ".join(run.models)),
        *((f"served at ({model})", url) for model, url in run.served_at.items()),
        ("prompt", f"{run.prompt} {run.prompt_sha256}".strip()),
        ("loop", f"K = {run.iterations}, J = {run.patience}{several}"),
        ("pictures", pictures if run.vision else ""),
        *(("given rule", rule) for rule in run.given_rules),
        ("tokens and cost", spent(history)),
        *([] if report is None else _verified_with(report)),
    ]
    return [(name, value) for name, value in facts if value]


def _verified_with(report: Report) -> list[tuple[str, str]]:
    facts = report.provenance
    return [
        ("controller", f"sha256 {facts.controller_sha256}"),
        ("map or world", f"sha256 {facts.map_sha256}"),
        ("params.json", f"sha256 {facts.params_sha256}"),
        ("sensors.py", f"sha256 {facts.sensors_sha256}"),
        ("suite", f"{facts.suite}, sha256 {facts.suite_sha256}"),
        ("profile", facts.profile + (" (nominal start only)" if facts.paper else "")),
        ("seed of the starts", str(facts.seed)),
        ("sandbox", facts.sandbox),
        ("limits", ", ".join(f"{k} {v:g}" for k, v in facts.limits.items())),
        ("versions", ", ".join(f"{k} {v}" for k, v in facts.versions.items())),
        *(("remark", text) for text in (*facts.warnings, *facts.left_out)),
    ]


def _commands(history: RunHistory, name: str) -> Iterator[tuple[str, str]]:
    """Commands to type in the parent of the run's folder, and what each does."""
    run = history.run
    problem = ["--set", f"{name}/{SET_FILE}"] if run.on_set else ["--task", name]
    if run.learner == AGENT:
        yield from _agent_commands(history, name, problem)
        return
    options, begin = _options(run, name), ["tdac", "synth", *problem, "--learner"]
    again = replace(options, optimizer=None, base_url=None)
    words = [*begin, run.learner, *words_of(options)]
    yield shlex.join(words), "repeat the run with new answers"
    words = [*begin, f"replay:{name}", *words_of(again)]
    yield shlex.join(words), "repeat the run with the recorded answers"
    if not run.finished and history.status != "running":
        more = () if run.enough is None else run.enough.words
        yield shlex.join(["tdac", "synth", "--resume", name, *more]), "resume the run"
    yield from _uses(history, name, problem)


def _options(run: Run, name: str) -> SynthOptions:
    """The options with which a run began, but for its Learner.

    Its files are in a folder of this name.
    """
    scope, usual = "set" if run.on_set else "task", SynthOptions()
    recorded = run.options | recorded_settings(run)
    names = {*usual.recorded(scope), "optimizer", "seed"}
    kept = {key: value for key, value in recorded.items() if key in names}
    kept["max_output"] = run.max_output or usual.max_output  # 0 in early records
    written = (run.folder / PROMPT_FILE).is_file()
    return replace(
        usual,
        **kept,
        prompt=f"{name}/{PROMPT_FILE}" if written else run.prompt,
        rules=Path(name, GIVEN_RULES_FILE) if run.given_rules else None,
        start_from=Path(name, GIVEN_FILE) if run.given_sha256 is not None else None,
    ).as_typed(scope)


def _agent_commands(
    history: RunHistory, name: str, problem: list[str]
) -> Iterator[tuple[str, str]]:
    """The commands of a run whose candidates an agent submitted."""
    run = history.run
    words = ["tdac", "mcp", *problem]
    words += ["--episodes", str(run.episodes)] if run.on_set else []
    yield shlex.join(words), "let an agent repeat the run"
    if not run.finished and history.status != "running":
        yield resume_line(run, name), "resume the run"
    yield from _uses(history, name, problem)


def _uses(
    history: RunHistory, name: str, problem: list[str]
) -> Iterator[tuple[str, str]]:
    """What can be done with the controller of a run."""
    run = history.run
    if run.on_set and run.tau is not None:
        verify = ["tdac", "verify", f"{name}/controller.py", *problem]
        yield shlex.join(verify), "verify the controller on public worlds"
    elif run.passed:
        yield shlex.join(["tdac", "verify", name]), "verify the controller again"
        video = ["tdac", "play", name, "--video", "drive.mp4"]
        yield shlex.join(video), "record a video of the drive"
