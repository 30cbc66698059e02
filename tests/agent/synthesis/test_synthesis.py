"""Algorithm 2 with scripted models: what is asked, what is kept, how it ends."""

import json
import os
import shutil
import subprocess
import sys

import pytest
import script
from script import STILL as NOTHING
from script import Script
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.errors import Fault, ProviderError, RunError
from tdac_agent.models.provider import PermanentFault, ProviderFault, Reply
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.verification.verify import verify

AT_ONCE = RetryPolicy(first_wait=0.0)


def code(source):
    return script.code(source, tokens_in=10, tokens_out=5)


@pytest.fixture
def policy_task(tmp_path):
    """The small task in the profile `policy`."""
    return load_task(write_small_task(tmp_path / "task", profile="policy"))


@pytest.fixture
def out(tmp_path):
    return tmp_path / "run"


def journal(folder):
    return [json.loads(x) for x in (folder / "journal.jsonl").read_text().splitlines()]


LEARNT = ("Drive towards the goal.", "Do not stand still.")
OPERATIONS = [{"op": "add", "scope": "code", "text": text} for text in LEARNT]
RULES = Reply(f"```json\n{json.dumps(OPERATIONS)}\n```", tokens_in=7)


def test_it_passes_after_rules_and_an_edit(policy_task, good_source, out, warm):
    """Two failures, rules, a failure, an edit that passes: k = 2, j = 1."""
    learner = Script(code(NOTHING), code(NOTHING + "\nX = 2\n"))
    optimizer = Script(code(NOTHING + "\nX = 1\n"), RULES, code(good_source))
    run = synthesize(policy_task, learner, optimizer, out=out, judge=warm)
    assert run.verified
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
    assert optimizer.requests[0].controller == NOTHING
    assert "no motion" in optimizer.requests[0].prompt
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
    assert load_run(folder).verified
    events = [record["event"] for record in journal(folder)]
    assert events[0] == "run.start"
    assert events[-1] == "run.end"
    rules = next(r for r in journal(folder) if r["event"] == "rules")["rules"]
    assert rules[0]["id"] == "R1"
    assert "test_end_to_end.py::test_progress" in rules[0]["evidence"]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "reply",
    [
        Reply("I cannot help with that.", stop="refusal"),
        Reply(f"```python\n{NOTHING}```", stop="length"),
        Reply("No code here."),
        Reply("```python\ndef policy(:\n```"),
    ],
)
def test_invalid_answers_are_asked_again_twice(
    policy_task, good_source, out, reply, warm
):
    """Then the iteration is spent and marked invalid; each answer is kept."""
    learner = Script(reply, reply, reply, code(good_source))
    run = synthesize(policy_task, learner, out=out, judge=warm)
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
    first = out / "iterations" / "k01" / "j0"
    replies = sorted(path.name for path in first.glob("generate.reply*"))
    assert replies == [
        *("generate.reply-2.md", "generate.reply-3.md", "generate.reply.md"),
    ]


GARBAGE = Reply("\n\n  lorem \x1b[31mipsum\n" + "dolor sit amet " * 99)


@pytest.mark.slow
def test_a_model_without_a_usable_answer_is_given_up(
    policy_task, good_source, out, warm
):
    """After three spent iterations the run is censored; to go on asks it once more."""
    paid = Script(*[GARBAGE] * 9)
    paid.paid = True
    expected = r"^script: 3 iterations in a row without a controller; in the last one, "
    with pytest.raises(Fault, match=expected + "none of 3 answers could be used: it "):
        synthesize(policy_task, paid, out=out, iterations=9, judge=warm)
    run = load_run(out)
    assert (run.status, run.censored, len(run.attempts)) == ("fault", True, 3)
    says = {r["says"] for r in journal(out) if r["event"] == "call.unused"}
    assert says == {("lorem [31mipsum " + "dolor sit amet " * 99)[:159] + "…"}
    paid = Script(*[GARBAGE] * 6, code(good_source))
    paid.paid = True
    run = synthesize(policy_task, paid, out=out, iterations=9, judge=warm)
    assert (run.tau, paid.answers) == (6, [])


def test_who_costs_nothing_may_answer_what_it_likes(policy_task, out, warm):
    """A simulation or a replay goes on to its last iteration."""
    run = synthesize(
        policy_task, Script(*[GARBAGE] * 15), out=out, iterations=5, judge=warm
    )
    assert (run.status, len(run.attempts)) == ("not verified", 5)


def test_faults_use_up_no_iteration(policy_task, good_source, out, warm):
    """A provider that cannot be reached is asked again; the second answer counts."""
    learner = Script(ProviderFault("503"), ProviderFault("503"), code(good_source))
    run = synthesize(
        policy_task, learner, out=out, iterations=1, retry=AT_ONCE, judge=warm
    )
    assert run.tau == 1
    faults = [r for r in journal(out) if r["event"] == "call.fault"]
    assert [fault["attempt"] for fault in faults] == [1, 2]
    assert {fault["fault"] for fault in faults} == {"transient"}


def test_four_faults_stop_the_run(policy_task, out, warm):
    """The run is neither verified nor failed, and its record says why."""
    learner = Script(*[ProviderFault("no route to host")] * 4)
    expected = r"^script: no route to host \(asked 4 times\)$"
    with pytest.raises(Fault, match=expected):
        synthesize(policy_task, learner, out=out, retry=AT_ONCE, judge=warm)
    assert learner.answers == []
    run = load_run(out)
    assert run.status == "fault"
    assert run.attempts == []
    assert "no route" in journal(out)[-1]["reason"]


def test_a_permanent_fault_keeps_what_there_is(policy_task, out, warm):
    """It is not asked again; the candidate before it stays on record."""
    learner = Script(code(NOTHING), PermanentFault("401 no such key"))
    with pytest.raises(Fault, match=r"^script: 401 no such key$"):
        synthesize(policy_task, learner, out=out, judge=warm)
    run = load_run(out)
    assert run.status == "fault"
    assert [(a.k, a.j, a.passed) for a in run.attempts] == [(1, 0, False)]
    assert (out / "iterations/k01/j0/generate.reply.md").is_file()
    assert (out / "iterations/k01/j1/edit.prompt.md").is_file()


def test_a_truncated_answer_gets_more_room(policy_task, good_source, out, warm):
    """It is never used, even where the code in it is whole, and asked for again."""
    cut = Reply(f"```python\n{good_source}```", stop="length")
    learner = Script(cut, code(good_source))
    run = synthesize(policy_task, learner, out=out, judge=warm)
    assert run.tau == 1
    first, second = (request.max_tokens for request in learner.requests)
    assert second == 2 * first


def test_more_room_than_a_model_can_have(policy_task, good_source, out, warm):
    """Where it is refused, the usual room is asked for; the run goes on."""
    cut, refused = (
        Reply("```python", stop="length"),
        PermanentFault("400 at most 16384"),
    )
    learner = Script(cut, refused, cut, refused, code(good_source))
    assert synthesize(policy_task, learner, out=out, judge=warm).tau == 1
    rooms = [request.max_tokens for request in learner.requests]
    usual = rooms[0]
    assert rooms == [usual, 2 * usual, usual, 2 * usual, usual]


def test_it_gives_up_after_k_iterations(policy_task, out, warm):
    """Nothing verified: no controller.py, status `not verified`."""
    learner = Script(code(NOTHING), RULES, code(NOTHING), RULES)
    run = synthesize(
        policy_task, learner, out=out, iterations=2, patience=0, judge=warm
    )
    assert run.status == "not verified"
    assert run.tau is None
    assert not run.controller.exists()
    assert learner.asked()[-1] == ("summarise", 2, 0)
    assert learner.requests[-1].report.verdict.failed_tests > 0


def test_an_interrupt_leaves_a_readable_run(policy_task, out, warm):
    """Ctrl-C in the middle of a call."""
    learner = Script(code(NOTHING), KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        synthesize(policy_task, learner, out=out, judge=warm)
    run = load_run(out)
    assert run.status == "interrupted"
    assert [(a.k, a.j) for a in run.attempts] == [(1, 0)]
    assert journal(out)[-1]["status"] == "interrupted"


def test_a_given_controller_is_tried_first(policy_task, good_source, out, warm):
    """`start_from` replaces the first answer of the learner."""
    learner = Script()
    run = synthesize(policy_task, learner, out=out, start_from=good_source, judge=warm)
    assert run.tau == 1
    assert learner.requests == []


@pytest.mark.slow
@pytest.mark.parametrize("source", ["", "# no line end"])
def test_a_given_controller_may_be_poor(policy_task, good_source, out, source, warm):
    """An empty file or one without a line end is a candidate like any other."""
    learner = Script(code(good_source))
    run = synthesize(policy_task, learner, out=out, start_from=source, judge=warm)
    assert [a.passed for a in run.attempts] == [False, True]


def test_builtin_needs_no_model(policy_task, out, warm):
    """The builtin learner verifies the small task by itself."""
    run = synthesize(policy_task, out=out, judge=warm)
    assert run.verified
    assert run.learner == run.optimizer == "builtin"
    assert run.tokens_in == 0


def test_an_unknown_learner(policy_task, out, warm):
    """The name is refused before anything is written."""
    with pytest.raises(ProviderError, match="unknown model 'gpt'; known: builtin, "):
        synthesize(policy_task, "gpt", out=out, judge=warm)
    assert not out.exists()


def test_a_folder_in_use(policy_task, out, warm):
    """A run never writes into a folder that holds something."""
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    with pytest.raises(RunError, match="is not empty"):
        synthesize(policy_task, out=out, judge=warm)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_a_run_folder_is_self_contained(tmp_path, good_source, warm):
    """Moved elsewhere it verifies with its own suite, and its controller runs alone."""
    folder = write_small_task(tmp_path / "task", suite="mine")
    (folder / "mine").mkdir()
    test = "def test_own(rollout):\n    assert rollout('nominal').reached, 'no'\n"
    (folder / "mine" / "test_mine.py").write_text(test)
    out = tmp_path / "run"
    learner = Script(code(good_source))
    task = load_task(folder, trust=True)
    assert synthesize(task, learner, out=out, judge=warm).verified
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
def test_without_refinement_the_prompt_stays(patience, asked, policy_task, out):
    """No rules are asked for, each new controller is asked for in the same words."""
    model = Script(*(code(f"{NOTHING}X = {n}\n") for n in range(4)))
    run = synthesize(
        policy_task, model, out=out, iterations=2, patience=patience, refine=False
    )
    assert model.asked() == asked
    prompts = {r.prompt for r in model.requests if r.kind == "generate"}
    assert len(prompts) == 1
    assert (run.refine, run.status) == (False, "not verified")
    assert run.setting == ("edit only" if patience else "best of N")
    with pytest.raises(RunError, match="refinement of the prompt"):
        synthesize(
            policy_task, Script(), out=halted(out), iterations=2, patience=patience
        )


def halted(folder):
    """The run as if its last process had been killed."""
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(record | {"status": "running"}))
    return folder
