"""`tdac demo`: replays a recorded run of a language model with live tests."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

from tdac_agent.cli import report
from tdac_agent.cli.console import Console
from tdac_agent.cli.display import has_display
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.synth import write
from tdac_agent.html_report.story import changed_in, told_of
from tdac_agent.library.listing import next_folder
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.history import gather_run, read_text
from tdac_agent.runs.ownership import load_task
from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import PROMPT_FILE, load_run
from tdac_agent.synthesis.options import SynthOptions

INTRODUCTION = (
    "A language model writes a controller from a question that says neither where y "
    "points nor which wheel turns the robot to the left. Its answers were recorded on "
    "{date}, each in a fresh conversation that contained only the printed question, "
    "and are unedited. The controllers drive and are tested live, on this machine. "
    "The same by hand:\n"
    "  tdac synth --task {task} --profile {profile} --prompt {prompt} "
    "--learner replay:demo\n"
)


def run(out: Path | None, as_json: bool) -> int:
    """Replays the bundled run, by default into a new folder; returns the exit code."""
    console = Console(stderr=as_json)
    recorded = load_run(DEMO)
    prompt = DEMO / PROMPT_FILE
    names = {"task": recorded.task, "profile": recorded.profile, "prompt": prompt}
    console.print(INTRODUCTION.format(date=recorded.started[:10], **names))
    with console.status("preparing the task …"):
        task = load_task(recorded.task).with_profile(recorded.profile)
    options = SynthOptions(
        learner="replay:demo",
        iterations=recorded.iterations,
        patience=recorded.patience,
        seed=recorded.seed,
        prompt=str(prompt),
        confirm=False,  # half a minute is enough for a first look
    )
    folder = out or next_folder("demo")
    code = write(problem_of(task), folder, options, console)
    if code == 0 and not as_json:
        _tell(folder, console)
        report.run(folder, None)
        _open(folder / report.DEFAULT)
    return code


def _tell(folder: Path, console: Console) -> None:
    """Prints the story of the run in plain sentences."""
    told = gather_run(folder)
    assert told.task is not None
    console.print()
    for number, one in enumerate(told.tried, 1):
        if number > 1:
            reply = read_text(one.folder, "edit.reply.md") or ""
            says = reply.lstrip().partition("\n")[0].replace("*", "")
            print_plain(
                console, f'  The model is told where and why. It answers: "{says}"'
            )
            console.print(f"  Its edit: {changed_in(one)}.")
        assert one.report is not None
        drove = told_of(one.report, told.task.nominal.dt)
        console.print(f"  Version {number}. {drove}")
    console.print()


def _open(page: Path) -> None:
    """Opens a page in the browser, if a person with a screen sees this terminal."""
    if sys.stdout.isatty() and has_display():
        webbrowser.open(page.resolve().as_uri())
