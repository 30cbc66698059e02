"""Repairs and rules with a program for a model: what it is asked, what is learnt."""

import json
import shlex
import sys
from pathlib import Path

import pytest
from changed_run import journal
from script import AHEAD, STILL
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent.prompting.rules import BEGIN, RepairRule, RuleBook
from tdac_agent.runs.run_record import Attempt, Run, load_rules, load_run

PROGRAM = Path(__file__).parents[1] / "scripted_model.py"
SLOW = "Drive no faster than 0.5 near walls."


def code(source):
    return f"Here it is.\n```python\n{source}```\n"


def rules(*operations):
    return f"```json\n{json.dumps(operations)}\n```\n"


def add(text, scope="environment"):
    return {"op": "add", "scope": scope, "text": text}


class Model:
    """The program, its answers, and what it was asked."""

    def __init__(self, folder, *replies):
        folder.mkdir()
        self.folder = folder
        for number, reply in enumerate(replies, 1):
            (folder / f"reply-{number}.md").write_text(reply)
        words = [sys.executable, str(PROGRAM), str(folder)]
        self.name = f"command:{shlex.join(words)}"

    def prompts(self):
        count = len(list(self.folder.glob("prompt-*.md")))
        files = (self.folder / f"prompt-{n}.md" for n in range(1, count + 1))
        return [file.read_text() for file in files]


@pytest.mark.slow
def test_rules_live_on(task, good_source, tmp_path, out, done, monkeypatch, warm):
    """Learnt, edited and dropped over three iterations; `tdac rules` shows it all."""
    model = Model(
        tmp_path / "model",
        code(STILL),
        rules(add(SLOW), add("Do not stand still."), add("DO NOT STAND STILL")),
        code(AHEAD),
        rules(
            {"op": "drop", "id": "R2", "reason": "it drives now"},
            {"op": "edit", "id": "R1", "text": "Turn before the wall at x = 70."},
            add("Do not stand still!"),
        ),
        code(good_source),
    )
    run = synthesize(task, model.name, out=out, iterations=3, patience=0, judge=warm)
    assert run.tau == 3
    prompts = model.prompts()
    assert len(prompts) == 5
    blocks = [prompt.partition(BEGIN)[2] for prompt in prompts]
    assert "(none yet)" in blocks[1]
    assert f"- {SLOW} [R1]\n- Do not stand still. [R2]\n# ===" in blocks[2]
    assert "- Turn before the wall at x = 70. [R1]\n# ===" in blocks[4]
    stable = prompts[0].partition(BEGIN)[0]
    assert all(stable in prompt for prompt in prompts)
    first, second, third = (attempt.failed_tests for attempt in run.attempts)
    cured = len(set(first) - set(second))
    told = f"cured {cured} of {len(first)} tests; more tests failed than before"
    assert f"- R2 (environment, since k=1; {told}): Do" in prompts[3]
    assert third == ()
    assert "k=1 j=0: " in prompts[3].partition("## Earlier attempts")[2]
    check_life(out)
    monkeypatch.setenv("COLUMNS", "80")
    shown = done("rules", out)
    every = f"cured {len(first)} of {len(first)} tests"
    for words in ("R2", "dropped in k=2: it drives now", f"was '{SLOW}'", every):
        assert words in " ".join(shown.split()), shown
    assert max(map(len, shown.splitlines())) <= 80
    shown = done("rules", out, "--json")
    assert json.loads(shown) == load_rules(out).model_dump(mode="json")


def check_life(folder):
    """The two rules of `test_rules_live_on` at the end of the run."""
    first, second = load_rules(folder).rules
    assert (first.id, first.in_force, first.born) == ("R1", True, 1)
    assert (first.tried, first.cured) == (1, 1)
    assert first.edits == (f"k=2: was {SLOW!r}",)
    assert "test_end_to_end.py::test_reaches_goal" in first.evidence
    assert (second.status, second.ended) == ("dropped", 2)
    notes = [record["notes"] for record in journal(folder, "rules")]
    assert notes[0][2] == "not added: it repeats R2"
    assert "not added: it repeats R2, which was ended in k=2" in notes[2]


@pytest.mark.slow
def test_a_malformed_answer_about_rules_is_asked_again(
    task, good_source, tmp_path, out, warm
):
    """With the reason; after three of them the rules stay, and the run goes on."""
    model = Model(
        tmp_path / "model",
        *(code(STILL), "- Do not stand still.", rules(add("x" * 201)), rules()),
        *(code(STILL), "no", "no", "no", code(good_source)),
    )
    run = synthesize(task, model.name, out=out, iterations=3, patience=0, judge=warm)
    assert run.tau == 3
    assert load_rules(out).rules == ()
    first, second, third = model.prompts()[1:4]
    assert second.startswith(first)
    assert "reason: expected one fenced ```json block, got no block." in second[-200:]
    assert "201 characters, at most 200" in third[-200:]
    assert third.count("could not be used") == 1


@pytest.mark.slow
def test_an_unusable_answer_is_asked_again_with_the_reason(
    task, good_source, tmp_path, out, warm
):
    """Nothing is guessed: not from two files, and not from a part of one."""
    two = code(good_source) + code(good_source.replace("1.0", "0.9"))
    part = code("def helper(obs):\n    return 0.0, 0.0\n")
    model = Model(tmp_path / "model", two, part, code(good_source))
    run = synthesize(task, model.name, out=out, iterations=1, judge=warm)
    assert run.tau == 1
    _, second, third = model.prompts()
    assert "two blocks that may be the file" in second[-200:]
    assert "no `def policy` at its top level" in third[-200:]
    folder = out / "iterations" / "k01" / "j0"
    assert (folder / "generate.prompt-3.md").read_text() == third
    assert (folder / "generate.reply-2.md").read_text() == part


@pytest.mark.slow
def test_earlier_attempts_are_told(task, good_source, tmp_path, out, warm):
    """One line each, the one in question left out; no figure of a held-out start."""
    model = Model(
        tmp_path / "model",
        *(code(STILL), code(AHEAD), code(f"{AHEAD}X = 1\n"), code(good_source)),
    )
    run = synthesize(task, model.name, out=out, iterations=1, patience=3, judge=warm)
    assert run.tau == 1
    first, second, third = (
        prompt.partition("## Earlier attempts, oldest first\n")[2]
        for prompt in model.prompts()[1:]
    )
    assert first == ""
    lines = second.partition("\n\n")[0].splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("- k=1 j=0: ")
    assert "no motion" in lines[0]
    lines = third.partition("\n\n")[0].splitlines()
    assert [line[:11] for line in lines] == ["- k=1 j=0: ", "- k=1 j=1: "]
    assert "nominal: collision in step " in lines[1]


@pytest.mark.slow
def test_the_prompt_is_on_record(task, good_source, tmp_path, out, warm):
    """A run says which template its questions were made from."""
    model = Model(tmp_path / "model", code(good_source))
    synthesize(task, model.name, out=out, prompt="underspecified", judge=warm)
    assert load_run(out).prompt == "underspecified"
    assert "## Advice" not in model.prompts()[0]


def test_a_broken_template_leaves_no_folder(tmp_path, refused):
    """Refused in one line before anything is asked or written."""
    (tmp_path / "mine.j2").write_text("{{ nothing }}")
    folder = write_small_task(tmp_path / "task")
    words = ("--task", folder, "--prompt", tmp_path / "mine.j2", "--out", "run")
    told = refused("synth", *words)
    assert "'nothing' is undefined" in told
    assert not Path("run").exists()


TESTS = tuple(f"test_end_to_end.py::test_{name}" for name in "abcdef")


def book_of(folder, run, *rules):
    """A run folder with a record and rules, and nothing else."""
    folder.mkdir()
    (folder / "run.json").write_text(run.model_dump_json())
    (folder / "rules.json").write_text(RuleBook(rules=rules).model_dump_json())
    return folder


def record(folder, **facts):
    plain = {"task": "a", "task_sha256": "", "learner": "l", "optimizer": "o"}
    plain |= {"iterations": 2, "patience": 0, "seed": 0, "started": "2026-01-01"}
    return Run(folder=folder, **{**plain, **facts})


def test_what_a_rule_cured_is_said_by_name(tmp_path, tdac):
    """The tests that passed each time, apart from those that did now and then."""
    rule = RepairRule(
        id="R1", text="Slow down.", born=1, evidence=TESTS, tried=2,
        cured=0, passes=(2, 1, 0, 2, 0, 0),
    )  # fmt: skip
    folder = book_of(tmp_path / "run", record(tmp_path / "run"), rule)
    _, shown, _ = tdac("rules", folder)
    told = " ".join(shown.split())
    assert (
        "effect: cured 2 of 6 tests in each of 2 tries, 1 more in some of them; cured: "
        "test_a, test_d; cured sometimes: test_b" in told
    )
    assert "failed before: test_a, test_b, test_c, test_d and 2 more" in told


INVALID = Attempt(k=1, j=0, valid=False, passed=False)
FAILED = Attempt(k=1, j=0, valid=True, passed=False, failed_tests=TESTS)


@pytest.mark.parametrize(
    ("facts", "why"),
    [
        ({}, "no iteration has failed after all its edits"),
        ({"attempts": [FAILED.model_copy(update={"passed": True})]}, "no iteration"),
        ({"attempts": [INVALID]}, "no answer of 1 iteration could be used"),
        (
            {"attempts": [INVALID, INVALID.model_copy(update={"k": 2})]},
            "no answer of 2 iterations could be used",
        ),
        ({"attempts": [INVALID, FAILED]}, "the optimizer added none"),
        ({"attempts": [FAILED], "refine": False}, "does not refine its prompt"),
    ],
)
def test_why_there_are_no_rules(tmp_path, tdac, facts, why):
    """By what came of the run, not by what usually does."""
    folder = book_of(tmp_path / "run", record(tmp_path / "run", **facts))
    _, shown, _ = tdac("rules", folder)
    assert f"no rules: {why}" in shown.replace("this run ", "")


def test_rules_of_what_is_no_run(tmp_path, refused):
    """A wrong folder and a damaged file are one clear line each."""
    told = refused("rules", tmp_path)
    assert "is not a run folder" in told


@pytest.mark.slow
def test_builtin_learns_by_rules(tmp_path, refused, rejected, done):
    """The template's own optimizer passes through the same rules, and says so."""
    folder = write_small_task(tmp_path / "task", horizon=40)
    rejected("synth", "--task", folder, "-K", "3", "-J", "0", "--out", "run")
    book = load_rules(Path("run"))
    assert book.in_force
    assert all(rule.text.startswith(("set ", "keep ")) for rule in book.rules)
    assert {rule.born for rule in book.rules} == {1, 2, 3}
    shown = done("rules", "run")
    assert "builtin" in shown
    (Path("run") / "rules.json").write_text("[1")
    told = refused("rules", "run")
    assert "is not a rules file" in told
