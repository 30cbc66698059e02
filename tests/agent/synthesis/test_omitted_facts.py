"""`tdac synth --omit`: which flags go together, and what a run keeps of them."""

import json
from pathlib import Path

import pytest
from script import Script

from tdac_agent.errors import Fault, RunError
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.problems.task_set import SetProblem
from tdac_agent.prompting.facts import FACTS, WORDINGS
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.synthesize import synthesize
from tdac_envs.core.errors import TaskError


def begin(few, out, **options):
    """Begins a run, or continues it, and returns the question that it asks."""
    model = Script(Fault("there is no answer"))
    options = {"search": "paper", **options}
    with pytest.raises(Fault, match="no answer"):
        synthesize(
            SetProblem(few), model, out=out, retry=RetryPolicy(first_wait=0), **options
        )
    return model.requests[0].prompt


def test_a_run_keeps_what_it_omits(few, out):
    """It is resumed with the same question, and is another run than one with others."""
    name = "facts-2:omit=turning,radius"
    question = begin(few, out, prompt="facts-2:omit=radius,turning", seed=1)
    assert "## The robot" in question
    assert "radius" not in question
    assert load_run(out).prompt == name
    settings = resume_arguments(out)
    assert settings["prompt"] == name
    assert begin(few, out, prompt=settings["prompt"], seed=1) == question
    with pytest.raises(RunError, match="different first question"):
        synthesize(
            SetProblem(few), Script(), out=out, prompt="facts", seed=1, search="paper"
        )


def test_the_library_omits_facts(few, out):
    """`omit` works as an argument, and with a name that has other facts."""
    question = begin(few, out, omit="radius, axle", prompt="facts:omit=rays", seed=1)
    assert "radius" not in question
    assert load_run(out).prompt == "facts:omit=radius,axle,rays"
    assert load_run(out).omit == "radius,axle,rays"
    again = {**resume_arguments(out), "out": out}
    assert begin(few, out, prompt=again["prompt"], seed=1) == question
    with pytest.raises(TaskError, match="'underspecified' is not made of facts"):
        begin(few, out, omit="radius", prompt="underspecified")


@pytest.mark.slow
def test_the_flags(done, tdac):
    """`--dry-run` prints the question; without --prompt, the first wording."""
    words = ("synth", "--set", "lost", "--dry-run")
    full = tdac(*words)[1]
    assert tdac(*words, "--prompt", "full")[1] == full
    told = tdac(*words, "--prompt", "facts")[1]
    assert "radius of 8 px" in told
    omitted = tdac(*words, "--omit", "radius, axle")[1]
    assert omitted == tdac(*words, "--omit", "axle,radius", "--prompt", "facts")[1]
    assert "radius" not in omitted
    everything = ",".join(FACTS)
    for kind in WORDINGS:
        bare = tdac(*words, "--prompt", kind, "--omit", everything)[1]
        assert bare == tdac(*words, "--prompt", "underspecified")[1]
    page = done("synth", "--help")
    assert all(fact in page for fact in FACTS)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--task", "maze", "--omit", "radius"), "--omit needs --set NAME"),
        (("--task", "maze", "--prompt", "facts"), "'facts' is for task sets"),
        (
            ("--set", "lost", "--omit", "radus"),
            "did you mean 'radius'?); the facts are",
        ),
        (
            ("--set", "lost", "--prompt", "underspecified", "--omit", "axle"),
            "'underspecified' is not made of facts; give --prompt facts or facts-2",
        ),
        (("--set", "lost", "--prompt", "full", "--omit", "axle"), "'full' is not made"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    """With --dry-run and without."""
    assert message in refused("synth", *words)
    assert message in refused("synth", *words, "--dry-run")


@pytest.mark.slow
def test_a_command_records_the_facts(done, refused, few, tmp_path):
    """The record has them in the order of the list; --resume takes them from there."""
    words = ("synth", "--set", tmp_path / "few.yaml", "--search", "paper")
    words += ("--episodes", "2", "--feedback-episodes", "1", "--out", "run")
    done(*words, "--omit", "radius, turning")
    record = json.loads(Path("run/run.json").read_text())
    assert record["prompt"] == "facts:omit=turning,radius"
    assert record["omit"] == "turning,radius"
    assert "has already finished" in done("synth", "--resume", "run")
    assert "leave out --omit" in refused("synth", "--resume", "run", "--omit", "axle")
    error = refused(*words, "--omit", "radius")
    assert "different omitted facts; different first question" in error
