"""A seeded 40 of each kind of generated attack, as real processes with limits."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import yaml
from hostile_files import KINDS, MAP_TASK, draw
from hostile_values import altered
from hostile_wire import conversations
from hostile_words import ALL, furnish, lines
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from test_words import problem_of

ZOO = Path(__file__).parents[1] / "zoo"
sys.path.append(str(ZOO))
from offers import Offer, excesses, take  # noqa: E402

EXAMPLES = 40
SEED = 20
READ_BY = {
    "task": ("synth", "--task", ".", "--dry-run"),
    "world task": ("synth", "--task", ".", "--dry-run"),
    "ros map": ("map", "map.yaml"),
    "params": ("synth", "--resume", "."),
    "run": ("report", "."),
    "rules": ("rules", "."),
    "journal": ("synth", "--learner", "replay:.", "--dry-run"),
    "report": ("report", "."),
    "training": ("runs", "."),
    "campaign": ("campaign", "few.yaml", "--dry-run"),
    "script": ("synth", "--learner", "scripted:weak.yaml", "--dry-run"),
}
READ = [kind for kind in KINDS if kind.name in READ_BY]
SOURCE = """
RAW = {raw!r}


def policy(obs):
    write(RAW)
    return 1.0, 0.5
"""
few = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    phases=[Phase.generate],  # a smaller example would take as long again
    suppress_health_check=list(HealthCheck),
)


def check(words: list[str] | tuple[str, ...], make) -> None:
    """A command ends with 0, 1 or 2, in a line, within limits, and leaves nothing."""
    outcome = take(Offer("generated", "", tuple(words), make, ""))
    assert problem_of(outcome.code, outcome.errors) == ""
    assert [e for e in excesses(outcome) if "tdac-cores" not in e] == []


@pytest.mark.slow
@seed(SEED)
@few
@given(st.sampled_from(READ).flatmap(lambda k: st.tuples(st.just(k), altered(k.whole))))
def test_files_as_processes_read_them(found):
    """Of each kind of file that a command reads."""
    kind, value = found

    def make(here: Path) -> None:
        kind.furnish(here)
        (here / kind.file).write_bytes(
            kind.text(value).encode("utf-8", "surrogatepass")
        )

    check(READ_BY[kind.name], make)


@pytest.mark.slow
@seed(SEED)
@few
@given(st.sampled_from(sorted(ALL)).flatmap(lambda name: lines(ALL[name])))
def test_lines_given_to_processes(words):
    """Of each command."""
    check(words, furnish)


@pytest.mark.slow
@seed(SEED)
@few
@given(conversations())
def test_answers_of_a_sandboxed_child(conversation):
    """A controller that writes to the judge's channel what a child would not."""
    _, script, at = conversation

    def make(here: Path) -> None:
        draw(here)
        (here / "task.yaml").write_text(yaml.safe_dump(MAP_TASK))
        own = SOURCE.format(raw=script[at].raw(5))
        (here / "controller.py").write_text((ZOO / "frames.py").read_text() + own)

    words = ("verify", "controller.py", "--profile", "policy", "--paper", "--json")
    check(words, make)
