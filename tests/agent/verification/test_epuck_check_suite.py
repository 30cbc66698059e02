"""The e-puck's suite proves itself, or is found out, as that for maps does."""

import json

import pytest

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.errors import Fault
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
from tdac_envs.worlds.bundled import bundled_worlds

QUICK_BAD = tuple(name for name in BAD if name != SLOW)


@pytest.fixture(scope="module")
def task():
    """A world that is soon crossed."""
    return load_task("epuck-crates")


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
@pytest.mark.parametrize(("profile", "repeats"), [("paper", 1), ("policy", 2)])
def test_the_shipped_suite_proves_itself(task, profile, repeats, warm):
    """The reference passes, each bad one fails for how it drives, each time alike."""
    check = check_suite(
        task, profile=profile, repeats=repeats, bad=QUICK_BAD, judge=warm
    )
    assert_proven(check, repeats)
    assert [row.controller for row in check.rows] == [REFERENCE, *QUICK_BAD]
    assert (check.profile, check.suite, check.task) == (profile, "epuck", task.name)
    assert SuiteCheck.model_validate_json(check.model_dump_json()) == check
    failures = [test for row in check.rows for test in row.failures]
    assert all(test.startswith("test_end_to_end.py::") for test in failures)


@pytest.mark.slow
def test_a_slow_controller_is_found_out(task, warm):
    """It drives as the reference does, but each call takes more than two steps."""
    check = check_suite(task, profile="policy", repeats=1, bad=(SLOW,), judge=warm)
    assert_proven(check, 1)
    assert "test_end_to_end.py::test_policy_is_fast_enough" in check.rows[-1].failures


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["paper", "policy"])
@pytest.mark.parametrize("name", bundled_worlds())
def test_every_bundled_world(name, profile, warm):
    """The shipped suite proves itself in each, from a seed of its own."""
    seed = 1 + bundled_worlds().index(name)
    world = load_task(TaskFile(env=EPUCK.id, world=name))
    check = check_suite(
        world, profile=profile, seed=seed, repeats=1, bad=QUICK_BAD, judge=warm
    )
    assert_proven(check, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_worlds())
def test_the_nominal_start_alone(name, warm):
    """The reference passes with `paper`, too."""
    world = load_task(TaskFile(env=EPUCK.id, world=name))
    source = privileged_controller(world.nominal, reference_paths(world.nominal, 0))
    assert verify(source, world, paper=True, judge=warm).failures == ()


@pytest.mark.slow
def test_a_task_that_needs_no_control_is_found_out(warm):
    """Where driving straight on is enough, the suite proves nothing about steering."""
    easy = load_task(
        TaskFile(
            env=EPUCK.id,
            world="crates",
            start=[-0.6, 0.2, 0.0],
            goal=[-0.3, 0.2],
            tolerance=0.2,
        )
    )
    bad = ("do-nothing", "constant")
    check = check_suite(easy, profile="policy", repeats=1, bad=bad, judge=warm)
    assert check.problems == (
        "constant passes: the tests require no more than it does",
    )


@pytest.mark.slow
def test_the_short_form(task, warm, tmp_path):
    """A proof, or one clear line about the test that asks for too much."""
    proof = prove_suite(task, profile="policy", judge=warm)
    assert [row.controller for row in proof.rows] == [REFERENCE, "do-nothing"]
    assert_proven(proof, 1)
    (tmp_path / "test_mine.py").write_text(
        "def test_keeps_far(rollout, task):\n"
        "    poses = rollout('nominal').trajectory.poses\n"
        "    gaps = [task.nominal.ground.gap(x, y) for x, y, _ in poses]\n"
        "    assert min(gaps) > 0.5, f'{min(gaps):.3f} m from something'\n"
    )
    with pytest.raises(Fault, match=r"test_keeps_far: 0\.\d+ m from something") as told:
        prove_suite(task, suite=tmp_path, judge=warm)
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_the_command_line(tdac):
    """`--task epuck` and a world of one's own: exit 0, and what was proven."""
    words = ["check-suite", "--repeats", 1, "--json"]
    for choice, name in (
        (["--task", "epuck"], "epuck"),
        (["--world", "corridor"], "corridor"),
    ):
        code, out, err = tdac(*words, *choice, "--profile", "policy")
        assert (code, err) == (0, "")
        record = json.loads(out)
        assert record["proven"] is True
        assert (record["suite"], record["task"]) == ("epuck", name)
        slow = record["rows"][-1]
        assert slow["controller"] == SLOW
        assert slow["passed"] == 0
