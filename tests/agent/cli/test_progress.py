"""What a person sees of a run, on a screen of 80 columns."""

import io
import json
import shlex
from pathlib import Path

import pytest
from rich.console import Console

from tdac_agent.cli.progress import SynthProgress
from tdac_agent.cli.run_view import list_tests, show_run
from tdac_agent.runs.run_record import Attempt, Run, Status

TESTS = tuple(f"test_end_to_end.py::test_number_{n}_of_many" for n in range(9))


def shown(*records):
    """The lines that records leave on the screen, and all of their words."""
    console = Console(file=io.StringIO(), width=80)
    with SynthProgress(console, "task: what it is") as progress:
        for record in records:
            progress(record)
    return told(console)


def told(console):
    text = console.file.getvalue()
    return text.splitlines(), " ".join(text.split())


def verified_end(**facts):
    plain = {"passed": False, "valid": True, "unchanged": False, "failed_tests": ()}
    return {"event": "verify.end", "k": 1, "j": 0, "notes": [], **plain, **facts}


def test_why_an_answer_was_not_used():
    """The reason, and how often it was asked for; nothing is said twice."""
    unused = {"event": "call.unused", "kind": "generate", "k": 1, "j": 0, "most": 3}
    unused["says"] = "lorem ipsum"
    reason = "it has no fenced block"
    end = verified_end(valid=False, notes=["x", f"none of 3 answers was: {reason}"])
    asked = [{**unused, "asked": n, "problem": reason} for n in (1, 2, 3)]
    _, words = shown(*asked, end)
    for n in (1, 2):
        assert f"k=1 j=0 answer {n} of at most 3 cannot be used: {reason};" in words
    assert words.count("asking again") == 2
    assert words.count("it says: “lorem ipsum”") == 1
    assert words.endswith(f"– k=1 j=0 none of 3 answers was: {reason}")


def test_an_answer_without_words_is_called_empty():
    """So that nobody looks for what was not shown."""
    unused = {"event": "call.unused", "kind": "generate", "k": 1, "j": 0, "most": 3}
    _, words = shown({**unused, "asked": 1, "problem": "it is no code", "says": ""})
    assert words.endswith("k=1 j=0 it is empty")


def test_the_check_of_the_suite_is_said_when_it_begins():
    """It may take half a minute, in which nothing else is to be seen."""
    lines, _ = shown({"event": "prove.start"})
    told = "  checking the suite: reference must pass, do-nothing must fail"
    assert lines == [told]


def test_a_long_line_goes_on_below_itself():
    """No word is broken, and what follows is not mistaken for another candidate."""
    lines, words = shown(verified_end(failed_tests=TESTS))
    names = ", ".join(f"test_number_{n}_of_many" for n in range(3))
    assert words == f"✘ k=1 j=0 9 failed: {names} and 6 more"
    assert len(lines) == 2
    assert lines[1].startswith(" " * len("✘ k=1 j=0  "))
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    ("answers", "unanswered", "lost", "expected"),
    [
        ({}, 0, 0.0, "0 recorded answers"),
        ({"generate": 1}, 0, 0.0, "1 recorded answer (1 controller)"),
        (
            {"generate": 2, "edit": 1, "summarise": 2},
            1,
            0.25,
            "5 recorded answers (2 controllers, 1 edit, 2 rule updates); one question "
            "has no recorded answer and is asked again; lost answers count as at most "
            "0.25 USD",
        ),
    ],
)
def test_what_is_on_record_is_told_apart(answers, unanswered, lost, expected):
    """By kind, so that it can be compared with the lines that follow."""
    facts = {"answers": answers, "unanswered": unanswered, "lost_usd": lost}
    _, words = shown({"event": "run.resume", "notes": [], **facts})
    assert words == f"task: what it is continuing: {expected}"


def test_some_names_and_how_many_more():
    """None is left out without a word."""
    assert list_tests(TESTS[:2], 2) == "test_number_0_of_many, test_number_1_of_many"
    assert list_tests(TESTS, 1) == "test_number_0_of_many and 8 more"
    assert list_tests((), 4) == ""


def run_with(folder: str, status: Status, **facts):
    return Run(
        folder=Path(folder),
        task="a:task:of mine",
        task_sha256="",
        learner="command:./my [bold] program",
        optimizer="o",
        iterations=1,
        patience=0,
        seed=0,
        status=status,
        started="2026-01-01T00:00:00+00:00",
        cost=None,
        **facts,
    )


def test_a_run_that_the_budget_has_stopped():
    """Sentences are wrapped; the command to go on stays in one piece."""
    console = Console(file=io.StringIO(), width=80, emoji=False)
    folder = "runs/a folder with [odd] words and a name that is rather long, is it not"
    run = run_with(
        folder,
        "budget",
        reason="72003 of 90000 tokens are spent or reserved, the next may take 36053",
        outlook="at most 3 questions are left: --max-tokens 108056 is enough",
        enough="--max-tokens 216112",
        max_tokens=90000,
        attempts=[
            Attempt(k=1, j=0, valid=True, passed=False, failed_tests=TESTS),
            Attempt(k=1, j=1, valid=False, passed=False, notes=("none was used: x",)),
        ],
    )
    show_run(run, console)
    lines, words = told(console)
    way = (
        f"  to continue: tdac synth --resume {shlex.quote(folder)} --max-tokens 216112"
    )
    assert lines[-1] == way
    assert max(map(len, lines[:-1])) <= 80
    assert "no tokens reported: each answer counts as the full amount reserved" in words
    assert "at most 3 questions are left: --max-tokens 108056 is enough" in words
    assert "a:task:of mine: command:./my [bold] program" in words
    assert "test_number_3_of_many and 5 more" in " ".join(
        words.replace("│", "").split()
    )
    assert "none was used: x" in words


@pytest.mark.parametrize("columns", [80, 120])
def test_runs_in_a_table(done, monkeypatch, columns):
    """Each run in one line, its folder and its status whole."""
    monkeypatch.setenv("COLUMNS", str(columns))
    names = ["runs/epuck-clutter-12", "runs/maze-1"]
    for name in names:
        run = run_with(name, "interrupted", tokens_in=1_234_567)
        Path(name).mkdir(parents=True)
        (Path(name) / "run.json").write_text(run.model_dump_json())
    out = done("runs")
    rows = [line for line in out.splitlines() if line.split()[:1] == ["runs/maze-1"]]
    (row,) = rows
    for words in ("interrupted", "0/1", "1234567", "unknown", "command:"):
        assert words in row
    assert ("started" in out) == ("a:task:of mine" in row) == (columns == 120)
    assert max(map(len, out.splitlines())) <= columns
    assert "to continue: tdac synth --resume runs/epuck-clutter-12" in out


def test_an_iteration_that_was_cut_off_is_counted(tdac):
    """Its candidate was written but not judged, so that there is no attempt of it."""
    run = run_with("runs/maze-1", "interrupted").model_copy(update={"iterations": 20})
    Path("runs/maze-1/iterations/k03/j0").mkdir(parents=True)
    Path("runs/maze-1/iterations/kept").mkdir()
    Path("runs/maze-1/run.json").write_text(run.model_dump_json())
    (row,) = json.loads(tdac("runs", "--json")[1])
    assert row["k"] == 3
    assert "3/20" in tdac("runs")[1]


def test_runs_of_a_campaign_are_found(tdac, done, monkeypatch):
    """Three levels below its folder; not in hidden folders, nor below another run."""
    record = run_with("x", "interrupted").model_dump_json()
    names = [f"campaigns/mine/runs/a-kind-of-run-{'x' * 20}/r000{n}" for n in (1, 2)]
    hidden, inside = "campaigns/mine/.old/r0001", f"{names[0]}/iterations/copy"
    for name in (*names, hidden, inside):
        Path(name).mkdir(parents=True)
        (Path(name) / "run.json").write_text(record)
    out = done("runs", "campaigns", "--json")
    assert sorted(row["run"] for row in json.loads(out)) == names
    monkeypatch.setenv("COLUMNS", "80")
    out = tdac("runs", "campaigns/mine")[1]
    assert out.startswith("in campaigns/mine:")
    assert out.count("interrupted") == len(names)
    assert f"to continue: tdac synth --resume {names[1]}" in out


def test_no_column_of_dashes(tdac):
    """What no run reports is left out; where some do, the dash is explained."""
    facts = {"tokens_in": 0, "tokens_out": 0}
    for name, tokens in (("a", {}), ("b", {"tokens_in": 7})):
        run = run_with(f"runs/{name}", "interrupted", **{**facts, **tokens})
        Path("runs", name).mkdir(parents=True)
        Path("runs", name, "run.json").write_text(run.model_dump_json())
        told = tdac("runs")[1]
        assert ("tokens" in told.splitlines()[1]) == (name == "b")
        assert ("–: no model was asked, or it does not report this" in told) == (
            name == "b"
        )
