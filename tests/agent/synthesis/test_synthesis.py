"""Algorithm 2 with scripted models: what is asked, what is kept, how it ends."""

import json
import os
import shutil
import subprocess
import sys

import pytest
import script
from changed_run import journal
from script import AHEAD, NO_RULES, STILL, Paid, Script
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault, ProviderError, RunError
from tdac_agent.models.provider import PermanentFault, ProviderFault, Reply
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.verification.verify import verify
from tdac_envs.core.errors import TaskError

LEARNT = ("Drive towards the goal.", "Do not stand still.")
OPERATIONS = [{"op": "add", "scope": "code", "text": text} for text in LEARNT]
RULES = Reply(f"```json\n{json.dumps(OPERATIONS)}\n```", tokens_in=7)
GARBAGE = Reply("\n\n  lorem \x1b[31mipsum\n" + "dolor sit amet " * 99)


def code(source):
    return script.code(source, tokens_in=10, tokens_out=5)


def halted(folder):
    """The run as if its last process had been killed."""
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(record | {"status": "running"}))
    return folder


# On a task and on a task set alike.


@pytest.mark.slow
def test_the_same_code_is_not_tested_again(write, ground, out):
    """Neither in an edit nor in a later iteration; the model is told."""
    # j=1 is unedited, k=2 begins with k=1's code, and its edit changes nothing.
    answers = [code(STILL), code(f"# the same\n{STILL}"), NO_RULES] * 2
    model, run = write(ground, *answers, iterations=2)
    known = [(attempt.unchanged, attempt.valid) for attempt in run.attempts]
    assert known == [(False, True), *[(True, True)] * 3]
    assert run.attempts[2].notes[-1] == "same code as k=1 j=0"
    assert run.attempts[2].failed_tests == run.attempts[0].failed_tests
    assert "The last edit changed nothing" in model.requests[2].prompt
    assert "The last edit changed nothing" not in model.requests[4].prompt
    assert (run.status, run.tau, run.controller.exists()) == ("not verified", None, 0)
    reports = [p for name in ("report", "episodes") for p in out.rglob(f"{name}.json")]
    tested = {path.relative_to(out / "iterations").parts[:2] for path in reports}
    assert tested == {("k01", "j0")}
    starts = [each for each in journal(out) if each["event"] == "verify.start"]
    assert len(starts) == ground.is_task


@pytest.mark.slow
def test_a_broken_run_goes_on_where_it_was(write, ground, out):
    """What is on record is neither asked nor tested again; nor is a finished run."""
    with pytest.raises(Fault, match=r"^script: no access$"):
        write(ground, code(STILL), PermanentFault("no access"))
    run = load_run(out)
    assert run.status == "fault"
    assert [(a.k, a.j, a.passed) for a in run.attempts] == [(1, 0, False)]
    assert (out / "iterations/k01/j0/generate.reply.md").is_file()
    assert (out / "iterations/k01/j1/edit.prompt.md").is_file()
    reports = [p for name in ("report", "episodes") for p in out.rglob(f"{name}.json")]
    before = {path: path.stat().st_mtime_ns for path in reports}
    assert len(before) == 1
    model, run = write(ground, code(ground.good))
    assert model.asked() == [("edit", 1, 1)]
    assert run.status == ("passed" if ground.is_task else "selected")
    assert run.controller.read_text() == ground.good
    assert {path: path.stat().st_mtime_ns for path in before} == before
    model, again = write(ground)
    assert (model.asked(), again.status) == ([], run.status)


@pytest.mark.slow
def test_an_interrupt_leaves_a_readable_run(write, ground, out):
    """Ctrl-C in the middle of a call; another run is then refused in its folder."""
    with pytest.raises(KeyboardInterrupt):
        write(ground, code(STILL), KeyboardInterrupt())
    run = load_run(out)
    assert (run.status, [(a.k, a.j) for a in run.attempts]) == ("interrupted", [(1, 0)])
    assert journal(out)[-1]["status"] == "interrupted"
    with pytest.raises(RunError, match="K 20 instead of 3"):
        write(ground, iterations=3)


@pytest.mark.slow_after(1)
def test_a_given_controller_is_tried_first(write, ground, tmp_path):
    """`start_from` replaces the first answer of the learner; a path is read."""
    file = tmp_path / "given.py"
    file.write_text(ground.good)
    model, run = write(ground, start_from=file)
    assert (run.tau, model.requests) == (1, [])


def test_an_unknown_keyword_is_named(write, ground, out):
    """Before anything is written; options and keywords are the same."""
    with pytest.raises(TypeError, match="no option 'iteration'; the options are ask"):
        write(ground, iteration=3)
    with pytest.raises(TaskError, match="improve"):
        write(ground, options=SynthOptions(improve=31))
    assert not out.exists()


@pytest.mark.slow
def test_the_budget_ends_a_run_that_more_tokens_continue(write, ground):
    """Nothing is delivered then, and no answer is paid for twice."""
    one = 40_000 if ground.is_task else 30_000  # enough for one question, not for two
    model = Paid(script.code(STILL))  # without tokens: all that is reserved counts
    _, run = write(ground, model=model, max_tokens=one, iterations=1)
    assert run.status == "budget"
    assert "--max-tokens" in str(run.enough)
    model = Paid(code(AHEAD), NO_RULES)
    _, run = write(ground, model=model, max_tokens=500_000, iterations=1)
    assert model.asked()[0] == ("edit", 1, 1)
    assert run.status == "not verified"


# On a task.


def test_it_passes_after_rules_and_an_edit(task, good_source, out, warm):
    """Two failures, rules, a failure, an edit that passes: k = 2, j = 1."""
    learner = Script(code(STILL), code(STILL + "\nX = 2\n"))
    optimizer = Script(code(STILL + "\nX = 1\n"), RULES, code(good_source))
    run = synthesize(task, learner, optimizer, out=out, judge=warm)
    assert run.passed
    assert run.tau == 2
    assert learner.asked() == [("generate", 1, 0), ("generate", 2, 0)]
    assert optimizer.asked() == [("edit", 1, 1), ("summarise", 1, 1), ("edit", 2, 1)]
    attempts = [(a.k, a.j, a.valid, a.passed) for a in run.attempts]
    assert attempts == [
        *[(1, 0, True, False), (1, 1, True, False)],
        *[(2, 0, True, False), (2, 1, True, True)],
    ]
    assert "Drive towards" not in learner.requests[0].prompt
    for later in (learner.requests[1], optimizer.requests[2]):
        assert later.rules == LEARNT
        assert all(f"- {rule} [R" in later.prompt for rule in LEARNT)
    assert optimizer.requests[0].controller == STILL
    assert "no motion" in optimizer.requests[0].prompt
    assert optimizer.requests[1].report.verdict.failed_tests > 0
    assert run.tokens_in == 10 * 4 + 7
    check_folder(out, good_source)


def check_folder(folder, source):
    """The folder is complete: evidence, working files, and every step on record."""
    assert (folder / "controller.py").read_text() == source
    names = "task.yaml run.json journal.jsonl report.json trajectory.png params.json"
    names += " occupancy.npy occupancy.png robot.png sensors.py preview.png"
    for name in names.split():
        assert (folder / name).stat().st_size > 0, name
    assert len(list((folder / "trajectories").glob("*.npz"))) == 6
    last = folder / "iterations" / "k02" / "j1"
    for name in ("edit.prompt.md", "edit.reply.md", "controller.py", "report.json"):
        assert (last / name).is_file(), name
    assert "+X = 1" in (folder / "iterations/k01/j1/controller.diff").read_text()
    assert load_run(folder).passed
    events = [record["event"] for record in journal(folder)]
    assert (events[0], events[-1]) == ("run.start", "run.end")
    rules = next(r for r in journal(folder) if r["event"] == "rules")["rules"]
    assert rules[0]["id"] == "R1"
    assert "test_end_to_end.py::test_progress" in rules[0]["evidence"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "reply",
    [
        Reply("I cannot help with that.", stop="refusal"),
        Reply(f"```python\n{STILL}```", stop="length"),
        Reply("No code here."),
        Reply("```python\ndef policy(:\n```"),
    ],
)
def test_invalid_answers_are_asked_again_twice(write, on_task, out, reply):
    """Then the iteration is spent and marked invalid; each answer is kept."""
    _, run = write(on_task, reply, reply, reply, code(on_task.good))
    assert run.tau == 2
    assert [(a.k, a.valid, a.passed) for a in run.attempts] == [
        (1, False, False),
        (2, True, True),
    ]
    why = run.attempts[0].notes[-1]
    assert why.startswith("none of 3 answers could be used: it")
    unused = [r for r in journal(out) if r["event"] == "call.unused"]
    assert [(r["k"], r["j"], r["asked"], r["most"]) for r in unused] == [
        (1, 0, asked, 3) for asked in (1, 2, 3)
    ]
    assert all(why.endswith(r["problem"]) for r in unused)
    replies = (out / "iterations" / "k01" / "j0").glob("generate.reply*")
    assert sorted(path.name for path in replies) == [
        *("generate.reply-2.md", "generate.reply-3.md", "generate.reply.md"),
    ]


@pytest.mark.slow
def test_a_model_without_a_usable_answer_is_given_up(write, on_task, out):
    """After three spent iterations the run is censored; to go on asks it once more."""
    expected = r"^script: 3 iterations in a row without a controller; in the last one, "
    with pytest.raises(Fault, match=expected + "none of 3 answers could be used: it "):
        write(on_task, model=Paid(*[GARBAGE] * 9), iterations=9)
    run = load_run(out)
    assert (run.status, run.censored, len(run.attempts)) == ("fault", True, 3)
    says = {r["says"] for r in journal(out) if r["event"] == "call.unused"}
    assert says == {("lorem [31mipsum " + "dolor sit amet " * 99)[:159] + "…"}
    paid = Paid(*[GARBAGE] * 6, code(on_task.good))
    _, run = write(on_task, model=paid, iterations=9)
    assert (run.tau, paid.answers) == (6, [])


def test_who_costs_nothing_may_answer_what_it_likes(write, on_task):
    """A simulation or a replay goes on to its last iteration."""
    _, run = write(on_task, *[GARBAGE] * 15, iterations=5)
    assert (run.status, len(run.attempts)) == ("not verified", 5)


def test_faults_use_up_no_iteration(write, on_task, out):
    """A provider that cannot be reached is asked again; the third answer counts."""
    faults = [ProviderFault("503")] * 2
    _, run = write(on_task, *faults, code(on_task.good), iterations=1)
    assert run.tau == 1
    faults = [r for r in journal(out) if r["event"] == "call.fault"]
    assert [fault["attempt"] for fault in faults] == [1, 2]
    assert {fault["fault"] for fault in faults} == {"transient"}


def test_four_faults_stop_the_run(write, on_task, out):
    """The run is neither verified nor failed, and its record says why."""
    expected = r"^script: no route to host \(asked 4 times\)$"
    with pytest.raises(Fault, match=expected):
        write(on_task, *[ProviderFault("no route to host")] * 4)
    assert (load_run(out).status, load_run(out).attempts) == ("fault", [])
    assert "no route" in journal(out)[-1]["reason"]


def test_a_truncated_answer_gets_more_room(write, on_task):
    """It is never used, even where the code in it is whole, and asked for again."""
    cut = Reply(f"```python\n{on_task.good}```", stop="length")
    model, run = write(on_task, cut, code(on_task.good))
    assert run.tau == 1
    first, second = (request.max_tokens for request in model.requests)
    assert second == 2 * first


def test_more_room_than_a_model_can_have(write, on_task):
    """Where it is refused, the usual room is asked for; the run goes on."""
    cut, refused = Reply("```python", stop="length"), PermanentFault("400 at most")
    model, run = write(on_task, cut, refused, cut, refused, code(on_task.good))
    assert run.tau == 1
    rooms = [request.max_tokens for request in model.requests]
    usual = rooms[0]
    assert rooms == [usual, 2 * usual, usual, 2 * usual, usual]


@pytest.mark.slow
@pytest.mark.parametrize("source", ["", "# no line end"])
def test_a_given_controller_may_be_poor(write, on_task, source):
    """An empty file or one without a line end is a candidate like any other."""
    _, run = write(on_task, code(on_task.good), start_from=source)
    assert [a.passed for a in run.attempts] == [False, True]


def test_builtin_needs_no_model(write, on_task):
    """The builtin learner verifies the small task by itself."""
    _, run = write(on_task, model="builtin")
    assert run.passed
    assert run.learner == run.optimizer == "builtin"
    assert run.tokens_in == 0


def test_what_cannot_begin_writes_nothing(write, on_task, out):
    """An unknown learner, hidden worlds of a task, a folder that holds something."""
    with pytest.raises(ProviderError, match="unknown model 'gpt'; known: builtin, "):
        write(on_task, model="gpt")
    with pytest.raises(TaskError, match=r"the task small .* has no hidden"):
        write(on_task, then_verify=True)
    assert not out.exists()
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    with pytest.raises(RunError, match="is not empty"):
        write(on_task, model="builtin")
    assert [path.name for path in out.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_a_run_folder_is_self_contained(tmp_path, good_source, out, warm):
    """Moved elsewhere it verifies with its own suite, and its controller runs alone."""
    folder = write_small_task(tmp_path / "task", suite="mine")
    (folder / "mine").mkdir()
    test = "def test_own(rollout):\n    assert rollout('nominal').reached, 'no'\n"
    (folder / "mine" / "test_mine.py").write_text(test)
    task = load_task(folder, trust=True)
    assert synthesize(task, Script(code(good_source)), out=out, judge=warm).passed
    moved = tmp_path / "elsewhere" / "moved"
    moved.parent.mkdir()
    out.rename(moved)
    shutil.rmtree(folder)
    report = verify(moved / "controller.py", load_task(moved))
    assert report.passed
    assert report.tests["own/test_mine.py::test_own"] == "passed"
    kept = json.loads((moved / "report.json").read_text())
    assert report.provenance.model_dump(mode="json") == {
        **kept["provenance"],
        "suite": "map2d + suite",
    }
    hidden = {"DISPLAY", "WAYLAND_DISPLAY"}
    process = subprocess.run(
        [sys.executable, "controller.py"],
        cwd=moved,
        env={k: v for k, v in os.environ.items() if k not in hidden},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    assert "goal reached" in process.stdout or "reached" in process.stdout
    assert (moved / "controller.mp4").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("patience", "asked"),
    [
        (0, [("generate", 1, 0), ("generate", 2, 0)]),
        (1, [("generate", 1, 0), ("edit", 1, 1), ("generate", 2, 0), ("edit", 2, 1)]),
    ],
)
def test_without_refinement_the_prompt_stays(write, on_task, patience, asked, out):
    """No rules are asked for, each new controller is asked for in the same words."""
    answers = [code(f"{STILL}X = {n}\n") for n in range(4)]
    terms = {"iterations": 2, "patience": patience}
    model, run = write(on_task, *answers, refine=False, **terms)
    assert model.asked() == asked
    prompts = {r.prompt for r in model.requests if r.kind == "generate"}
    assert len(prompts) == 1
    assert (run.refine, run.status) == (False, "not verified")
    assert run.setting == ("edit only" if patience else "best of N")
    with pytest.raises(RunError, match="refinement of the prompt"):
        write(on_task, out=halted(out), **terms)
