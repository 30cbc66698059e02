"""`tdac demo`: replays a recorded run of a language model with live tests."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.cli.console import Console
from tdac_agent.cli.synth import write
from tdac_agent.library.listing import next_folder
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.ownership import load_task
from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.options import SynthOptions

INTRODUCTION = (
    "Replaying a language model's answers to the [bold]{prompt}[/] prompt for the task "
    "[bold]{task}[/], recorded {date}. They are unedited; each is from a fresh "
    "conversation that contained only the printed prompt. The controllers and all "
    "tests run live on this machine; a line marks each question that therefore differs "
    "from the recorded one. The same by hand:\n"
    "  tdac synth --task {task} --prompt {prompt} --learner replay:demo\n"
)


def run(out: Path | None, as_json: bool) -> int:
    """Replays the bundled run, by default into a new folder; returns the exit code."""
    console = Console(stderr=as_json)
    recorded = load_run(DEMO)
    names = {"prompt": recorded.prompt, "task": recorded.task}
    console.print(INTRODUCTION.format(date=recorded.started[:10], **names))
    with console.status("preparing the task …"):
        task = load_task(recorded.task)
    options = SynthOptions(
        learner="replay:demo",
        iterations=recorded.iterations,
        patience=recorded.patience,
        seed=recorded.seed,
        prompt=recorded.prompt,
        confirm=False,  # there is no recorded answer to a failed confirmation
    )
    return write(problem_of(task), out or next_folder("demo"), options, console)
