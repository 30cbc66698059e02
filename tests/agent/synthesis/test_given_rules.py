"""Rules of earlier runs: exported, given to a run, and told in its report."""

import json
from pathlib import Path

import pytest
from script import NO_RULES, STILL, Script, code
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent.models.provider import Reply
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.prompting.given_rules import (
    given_book,
    given_lines,
    read_given,
    shared_rules,
    written,
)
from tdac_agent.prompting.prompt import PromptError
from tdac_agent.prompting.rules import MAX_RULE_TOKENS, RuleBook
from tdac_agent.runs.run_record import load_rules, load_run

AT_ONCE = RetryPolicy(first_wait=0.0)
LEARNT = [
    ("task", "The gap is on the left."),
    ("code", "Return plain floats."),
    ("environment", "Slow down before a turn."),
]


def answer(rules):
    operations = [{"op": "add", "scope": s, "text": t} for s, t in rules]
    return Reply(f"```json\n{json.dumps(operations)}\n```")


@pytest.fixture
def learnt(task, tmp_path, warm):
    """A run that has learnt three rules, and did not succeed."""
    model = Script(code(STILL), answer(LEARNT))
    given = {"out": tmp_path / "first", "judge": warm, "retry": AT_ONCE}
    synthesize(task, model, iterations=1, patience=0, **given)
    return tmp_path / "first"


@pytest.mark.slow
def test_what_was_learnt_on_one_task_is_given_to_the_next(
    learnt, task, tmp_path, warm, good_source, tdac, refused, done
):
    """A rule about one task stays there; the next report names the others."""
    file = tmp_path / "rules.md"
    code_, said, err = tdac("rules", "export", learnt, learnt, "--out", file)
    assert (code_, err) == (0, "")
    assert f"2 of 6 rules in force; to use them: tdac synth --rules {file}" in said
    text = file.read_text()
    file.write_text(f"{text}- [code] Mine.\n")
    code_, _, err = tdac("rules", "export", learnt, "--out", file)
    assert (code_, "has other rules" in err, "Mine" in file.read_text()) == (2, 1, 1)
    file.write_text(text)
    assert "- [code] Return plain floats.\n" in text
    assert "Learnt on small by script." in text
    assert "gap" not in text
    model = Script(code(STILL), code(good_source))
    given = {"out": tmp_path / "next", "judge": warm, "retry": AT_ONCE}
    run = synthesize(task, model, rules=read_given(file), **given)
    assert run.passed
    for request in model.requests:
        assert "- Return plain floats. [R1]" in request.prompt
    assert set(run.given_rules) == {
        "[code] Return plain floats.",
        "[environment] Slow down before a turn.",
    }
    book = load_rules(tmp_path / "next")
    assert [(rule.born, rule.tried) for rule in book.rules] == [(0, 1), (0, 1)]
    page = reading(tmp_path / "next")
    assert "[code] Return plain floats." in page
    assert "--rules next/given_rules.md" in page
    assert read_given(tmp_path / "next" / "given_rules.md") == read_given(file)
    said = done("rules", tmp_path / "next")
    assert "given at the beginning" in said
    assert "given; more tests failed than before in" in said
    # Other rules make another run.
    err = refused("synth", "--task", task.folder, "--out", tmp_path / "next")
    assert "different given rules" in err


@pytest.mark.slow
def test_a_run_with_given_rules_is_resumed(task, tmp_path, warm, good_source):
    file = tmp_path / "rules.md"
    file.write_text("- Keep right.\n")

    class Stop(Exception):
        pass

    given = {"out": tmp_path / "run", "judge": warm, "retry": AT_ONCE}
    model = Script(code(STILL), Stop())
    with pytest.raises(Stop):
        synthesize(task, model, rules=read_given(file), **given)
    before = load_run(tmp_path / "run")
    rules = given_book(before.given_rules)
    run = synthesize(task, Script(code(good_source)), rules=rules, **given)
    assert run.passed
    assert run.given_rules == ("[environment] Keep right.",)


def test_the_prompt_has_the_given_rules(done, tmp_path):
    """Also on a task set."""
    Path("rules.md").write_text("# Mine\n\nFor all.\n\n- [code] Use no globals.\n")
    for about in (("--task", "maze"), ("--set", "unknown")):
        out = done("synth", *about, "--rules", "rules.md", "--dry-run")
        assert "- Use no globals. [R1]" in out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing\n", "has no rule: expected lines such as"),
        ("- [code] ok\n- see https://a.b\n", "line 2: a rule must not contain"),
        ("- " + "x" * 201 + "\n", "line 1: 201 characters, at most 200"),
        (
            "".join(f"- rule {n} {'word ' * 20}\n" for n in range(60)),
            f"at most {MAX_RULE_TOKENS}: leave some out",
        ),
    ],
)
def test_a_wrong_rules_file_is_one_line(text, message, refused):
    Path("rules.md").write_text(text)
    err = refused("synth", "--rules", "rules.md", "--dry-run")
    assert message in err


def test_what_cannot_be_exported_is_one_line(task, tmp_path, warm, refused):
    given = {"out": tmp_path / "none", "judge": warm, "retry": AT_ONCE}
    synthesize(task, Script(code(STILL), NO_RULES), iterations=1, patience=0, **given)
    err = refused("rules", "export", tmp_path / "none")
    assert "no rule to export" in err
    with pytest.raises(PromptError, match="cannot read the rules in"):
        read_given(tmp_path / "nosuch.md")


def test_harmful_rules_are_not_shared_and_the_most_useful_come_first():
    book = RuleBook()
    for number, text in enumerate(("Bad one.", "Good one.", "Other advice.")):
        book = book.add(text, "code", 1, ("a",))
        fields = [{"worse": 2}, {"tried": 2, "passes": (2,)}, {}][number]
        book = book.change(f"R{number + 1}", **fields)
    kept = shared_rules([book, book])
    assert [rule.text for rule in kept] == ["Good one.", "Other advice."]
    lines = given_lines(RuleBook(rules=tuple(kept)))
    assert given_lines(given_book(lines)) == lines
    assert "- [code] Good one." in written(kept, "From here.")
