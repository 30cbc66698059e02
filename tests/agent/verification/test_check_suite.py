"""Suites prove themselves, or are found out: by the reference, bad ones and repeats."""

import json

import pytest
from changed_run import journal
from script import Paid, code
from small import SHORT, write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.runs.run_record import load_run
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.task_file import TaskFile
from tdac_agent.verification.suite.privileged import (
    BAD,
    REFERENCE,
    SLOW,
    privileged_controller,
    reference_paths,
)
from tdac_agent.verification.suite.proof import SuiteCheck
from tdac_agent.verification.suite_check import check_suite, prove_suite
from tdac_agent.verification.verify import verify
from tdac_envs.mapping.bundled import bundled_maps
from tdac_envs.worlds.bundled import bundled_worlds

IMPOSSIBLE = """
def test_flies(rollout):
    assert rollout("nominal").trajectory.steps < 3, "it took 3 steps or more"
"""
VACUOUS = "def test_anything(controller):\n    assert controller.source\n"
FAR = """
def test_keeps_far(rollout, task):
    poses = rollout("nominal").trajectory.poses
    gaps = [task.nominal.ground.gap(x, y) for x, y, _ in poses]
    assert min(gaps) > 0.5, f"{min(gaps):.3f} m from something"
"""
QUICK_BAD = tuple(name for name in BAD if name != SLOW)
WORLDS = [TaskFile(env=EPUCK.id, world=name) for name in bundled_worlds()]
BUNDLED = [*bundled_maps(), *WORLDS]
NAMES = [*bundled_maps(), *(f"world {name}" for name in bundled_worlds())]


@pytest.fixture
def task(tmp_path):
    """The small room with a short way."""
    return load_task(write_small_task(tmp_path / "task", **SHORT))


@pytest.fixture
def suite_of(tmp_path):
    """Makes a suite folder of one file."""

    def make(text):
        folder = tmp_path / "mine"
        folder.mkdir()
        (folder / "test_mine.py").write_text(text)
        return folder

    return make


def assert_proven(check, repeats):
    """The reference always passed, the others never, and the repeats agree."""
    assert check.problems == ()
    assert check.proven
    for row in check.rows:
        assert row.repeats == (1 if row.controller == SLOW else repeats)
        assert row.passed == (row.repeats if row.controller == REFERENCE else 0)
        assert row.disagreements == ()
        assert bool(row.failures) != (row.controller == REFERENCE)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["paper", "policy"])
def test_the_shipped_suite_proves_itself(task, profile, warm):
    """The reference passes, each bad controller fails, twice alike; all is reported.

    The bad ones fail for what they do: what is read from the file, and each function
    but the policy, is right.
    """
    steps = []
    check = check_suite(
        task, profile=profile, repeats=2, judge=warm, on_progress=steps.append
    )
    assert_proven_on(check, task, profile, BAD, 2)
    assert (check.suite, check.task) == ("map2d", "small")
    assert check.seed == seed_of(b"", task)
    assert check.notes == ()
    assert steps[:3] == ["reference, 1 of 2", "reference, 2 of 2", "do-nothing, 1 of 2"]
    assert steps[-1] == "slow"
    assert "test_end_to_end.py::test_policy_is_fast_enough" in check.rows[-1].failures


@pytest.mark.slow
@pytest.mark.parametrize(("profile", "repeats"), [("paper", 1), ("policy", 2)])
def test_the_suite_of_worlds_proves_itself(crates, profile, repeats, warm):
    """The reference passes, each bad one fails for how it drives, each time alike."""
    check = check_suite(
        crates, profile=profile, repeats=repeats, bad=QUICK_BAD, judge=warm
    )
    assert_proven_on(check, crates, profile, QUICK_BAD, repeats)
    assert check.suite == "epuck"


def assert_proven_on(check, task, profile, bad, repeats):
    """The record names task and profile, and the bad ones fail for how they drive."""
    assert_proven(check, repeats)
    assert [row.controller for row in check.rows] == [REFERENCE, *bad]
    assert (check.profile, check.task) == (profile, task.name)
    assert SuiteCheck.model_validate_json(check.model_dump_json()) == check
    failures = [test for row in check.rows for test in row.failures]
    assert all(test.startswith("test_end_to_end.py::") for test in failures)


@pytest.mark.slow
def test_a_slow_controller_is_found_out(crates, warm):
    """It drives as the reference does, but each call takes more than two steps."""
    check = check_suite(crates, profile="policy", repeats=1, bad=(SLOW,), judge=warm)
    assert_proven(check, 1)
    assert "test_end_to_end.py::test_policy_is_fast_enough" in check.rows[-1].failures


@pytest.mark.slow
def test_five_repeats_agree(small_task, warm):
    """As the command does it by default, with another seed."""
    assert_proven(check_suite(small_task, seed=7, judge=warm), 5)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["paper", "policy"])
@pytest.mark.parametrize("number", range(len(BUNDLED)), ids=NAMES)
def test_every_bundled_task(number, profile, warm):
    """The shipped suite proves itself on each, from a seed of its own."""
    check = check_suite(
        load_task(BUNDLED[number]),
        profile=profile,
        seed=1 + number,
        repeats=1,
        bad=QUICK_BAD,
        judge=warm,
    )
    assert_proven(check, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", BUNDLED, ids=NAMES)
def test_the_nominal_start_alone(name, warm):
    """The reference passes with `paper`, too."""
    task = load_task(name)
    ways = reference_paths(task.nominal, 0)
    source = privileged_controller(task.nominal, ways)
    assert verify(source, task, paper=True, judge=warm).failures == ()


@pytest.mark.slow
def test_the_impossible_is_found_out(task, suite_of, warm):
    """A test that the reference fails is named, with its message."""
    check = check_suite(task, suite=suite_of(IMPOSSIBLE), repeats=1, bad=(), judge=warm)
    assert not check.proven
    assert check.problems == (
        "the reference fails own/test_mine.py::test_flies: it took 3 steps or more",
    )


@pytest.mark.slow
def test_a_suite_that_tests_nothing_is_found_out(task, suite_of, warm):
    """Whatever bad controller passes is named."""
    check = check_suite(
        task,
        shipped=suite_of(VACUOUS),
        repeats=2,
        bad=("do-nothing", "raising"),
        judge=warm,
    )
    assert not check.proven
    assert [row.passed for row in check.rows] == [2, 2, 2]
    assert check.problems == (
        "do-nothing passes in 2 of 2 repeats: the tests require no more than it does",
        "raising passes in 2 of 2 repeats: the tests require no more than it does",
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map2d", "epuck"])
def test_a_task_that_needs_no_control_is_found_out(kind, tmp_path, warm):
    """Where driving straight on is enough, the suite proves nothing about steering."""
    if kind == "map2d":
        changes = {"start": [95, 60, 0.0], "goal": [140, 60], "tolerance": 30}
        easy = load_task(write_small_task(tmp_path / "easy", **changes))
    else:
        ends = {"start": (-0.6, 0.2, 0.0), "goal": (-0.3, 0.2), "tolerance": 0.2}
        easy = load_task(TaskFile(env=EPUCK.id, world="crates", **ends))
    bad = ("do-nothing", "constant")
    check = check_suite(easy, profile="policy", repeats=1, bad=bad, judge=warm)
    assert check.problems == (
        "constant passes: the tests require no more than it does",
    )


@pytest.mark.slow
def test_repeats_that_disagree_are_found_out(task, suite_of, tmp_path, warm):
    """A test with a mood of its own is named, with what it said each time."""
    moods = tmp_path / "moods.txt"
    moods.write_text("1")
    text = f"""
from pathlib import Path

def test_mood():
    moods = Path({str(moods)!r})
    moods.write_text(moods.read_text() + "1")
    assert len(moods.read_text()) % 2 == 0, "not now"
"""
    suite = suite_of(text)
    check = check_suite(
        task, profile="policy", suite=suite, repeats=3, bad=(), judge=warm
    )
    assert [row.passed for row in check.rows] == [2]
    name = "own/test_mine.py::test_mood"
    assert check.problems == (
        f"the reference fails {name}: not now",
        f"the repeats of reference disagree: {name} is passed, failed, passed",
    )


@pytest.mark.slow
def test_own_tests_that_nothing_fails_are_noted(task, suite_of, warm):
    """They may be right, so they are no problem; one that tells controllers apart is
    not mentioned."""
    keeps = """
def test_hears_no_error(rollout):
    episode = rollout("nominal")
    assert episode.error is None, episode.error
"""
    bad = ("do-nothing", "raising")
    suite = suite_of(VACUOUS + keeps)
    check = check_suite(
        task, profile="policy", suite=suite, repeats=1, bad=bad, judge=warm
    )
    assert check.proven
    assert check.notes == (
        "every bad controller passes own/test_mine.py::test_anything",
    )


def test_a_suite_that_cannot_be_collected_is_a_fault(task, suite_of, warm):
    """Neither proven nor not."""
    suite = suite_of("import nosuchmodule\n")
    with pytest.raises(Fault, match="suite is broken"):
        check_suite(task, suite=suite, judge=warm)


def test_arguments_that_make_no_sense(task, tmp_path, warm):
    """No repeats, no suite."""
    with pytest.raises(ValueError, match="at least 1 repeat, got 0"):
        check_suite(task, repeats=0, judge=warm)
    with pytest.raises(ControllerFileError, match="no suite"):
        check_suite(task, suite=tmp_path / "nothing", judge=warm)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        (
            "task",
            IMPOSSIBLE.replace("more", "more\\n" + "and more " * 100),
            "suite failed its check: the reference",
        ),
        ("crates", FAR, r"test_keeps_far: 0\.\d+ m from something"),
    ],
)
def test_the_short_form(name, text, reason, suite_of, warm, request):
    """A proof, or one clear line that says what is wrong."""
    task = request.getfixturevalue(name)
    proof = prove_suite(task, profile="policy", judge=warm)
    assert [row.controller for row in proof.rows] == [REFERENCE, "do-nothing"]
    assert_proven(proof, 1)
    with pytest.raises(Fault, match=reason) as fault:
        prove_suite(task, suite=suite_of(text), judge=warm)
    assert "\n" not in str(fault.value)
    assert len(str(fault.value)) < 400


@pytest.mark.slow
@pytest.mark.parametrize(
    ("choice", "name"),
    [(["--task", "epuck"], "epuck"), (["--world", "corridor"], "corridor")],
)
def test_the_command_line(choice, name, tdac):
    """`--task epuck` and a world of one's own: exit 0, and what was proven."""
    words = ["check-suite", "--repeats", 1, "--json", *choice, "--profile", "policy"]
    code, out, err = tdac(*words)
    assert (code, err) == (0, "")
    record = json.loads(out)
    assert record["proven"] is True
    assert (record["suite"], record["task"]) == ("epuck", name)
    assert record["rows"][-1]["controller"] == SLOW
    assert record["rows"][-1]["passed"] == 0


@pytest.mark.slow
def test_a_run_pays_nothing_for_a_broken_suite(tmp_path, good_source, warm):
    """It ends as a fault, with the reason on record, before the first call."""
    folder = write_small_task(tmp_path / "task", suite="mine", profile="policy")
    (folder / "mine").mkdir()
    (folder / "mine" / "test_mine.py").write_text(IMPOSSIBLE)
    learner, out = Paid(code(good_source)), tmp_path / "run"
    task = load_task(folder, trust=True)
    with pytest.raises(Fault, match=r"own/test_mine\.py::test_flies: it took 3 steps"):
        synthesize(task, learner, out=out, judge=warm)
    assert learner.requests == []
    assert load_run(out).status == "fault"
    records = journal(out)
    assert [r["event"] for r in records] == ["run.start", "prove.start", "run.end"]
    assert "the suite failed its check" in records[-1]["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("who", ["learner", "optimizer"])
def test_a_paid_run_begins_with_the_proof(tmp_path, good_source, who, warm):
    """Whoever of the two is paid; it is on record before the first call."""
    task = load_task(write_small_task(tmp_path / "task", profile="policy"))
    paid, out = Paid(code(good_source)), tmp_path / "run"
    providers = {"learner": "builtin", who: paid}
    seen = []
    run = synthesize(task, **providers, out=out, judge=warm, on_event=seen.append)
    assert run.passed
    doing = [record["doing"] for record in seen if record["event"] == "prove.step"]
    assert doing == ["reference", "do-nothing"]
    assert len(paid.requests) == (who == "learner")
    records = journal(out)
    begun = [record["event"] for record in records][:4]
    assert begun == ["run.start", "prove.start", "prove.end", "call.intent"]
    assert records[2]["proven"] is True
    assert records[2]["suite"] == "map2d"


@pytest.mark.slow
def test_what_costs_nothing_needs_no_proof(tmp_path, warm):
    """A run of the builtin learner loses no time."""
    task = load_task(write_small_task(tmp_path / "task", profile="policy"))
    assert synthesize(task, out=tmp_path / "run", judge=warm).passed
    assert not any(r["event"].startswith("prove") for r in journal(tmp_path / "run"))
