"""Verdicts: what passes, what fails, and that nothing else does either."""

import glob
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rich.console import Console
from script import STILL
from small import write_small_task

from tdac_agent.cli.report_view import show_report
from tdac_agent.episodes.episode import as_wheels, wrong_action
from tdac_agent.errors import ControllerFileError
from tdac_agent.sandbox import Limits
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.verify import load_trajectories, read_source, verify


def failed_with(report, test):
    """The message of a failed test."""
    return next(f.message for f in report.failures if f.test.endswith(f"::{test}"))


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(("profile", "tests"), [("paper", 41), ("policy", 21)])
def test_a_good_controller_passes(small_task, good_source, profile, tests, no_traces):
    """A controller that solves the task is verified, in both profiles."""
    report = verify(good_source, small_task, profile=profile)
    assert report.failures == ()
    assert report.passed
    assert report.verdict.expected == report.verdict.passed_tests == tests
    assert set(report.tests.values()) == {"passed"}
    names = ["nominal", *(f"jitter {n}" for n in range(1, 6))]
    assert [episode.name for episode in report.episodes] == names
    assert [episode.held_out for episode in report.episodes] == [False] * 3 + [True] * 3
    assert report.provenance.profile == profile


def test_doing_nothing_fails(small_task, warm):
    """A controller that stands still is not verified, and the diagnosis says so."""
    report = verify(STILL, small_task, profile="policy", judge=warm)
    assert not report.passed
    assert report.tests["test_end_to_end.py::test_progress"] == "failed"
    assert report.tests["test_end_to_end.py::test_no_collisions"] == "passed"
    causes = {f.diagnosis.cause for f in report.failures if f.diagnosis}
    assert causes == {"no motion"}


def shown(report):
    """What the terminal gets of a report."""
    console = Console(file=io.StringIO(), width=300, highlight=False)
    show_report(report, console)
    return console.file.getvalue()


@pytest.mark.slow
def test_a_failure_of_run_episode_has_that_name(small_task, good_source, warm):
    """What drives it is said: the policy's own episode begins at the same start."""
    raising = "\n\ndef run_episode(env, max_steps):\n    raise KeyError('speeds')\n"
    report = verify(good_source + raising, small_task, judge=warm)
    found = [failure.diagnosis for failure in report.failures]
    assert [diagnosis.episode for diagnosis in found] == ["run_episode"] * 2
    assert shown(report).count("KeyError") == 1
    assert "what happened: run_episode: error: " in shown(report)


@pytest.mark.slow
def test_a_cause_is_told_once(small_task, warm):
    """A controller that cannot be imported fails most tests for one reason."""
    report = verify("raise KeyError('speeds')\n", small_task, judge=warm)
    assert len(report.failures) > 20
    assert shown(report).count("KeyError") == 1
    assert "what happened: nominal: error: " in shown(report)


def test_evidence_is_kept(small_task, good_source, tmp_path, warm):
    """`out` gets a report.json that reads back as it was, and each trajectory."""
    report = verify(good_source, small_task, profile="policy", out=tmp_path, judge=warm)
    text = (tmp_path / "report.json").read_text()
    assert Report.model_validate_json(text) == report
    trajectories = load_trajectories(tmp_path / "trajectories")
    assert next(iter(trajectories)) == "nominal"
    for episode in report.episodes:
        assert trajectories[episode.name].steps == episode.steps
        assert len(trajectories[episode.name].poses) == episode.steps + 1


def test_paper_runs_the_nominal_start_only(small_task, good_source, warm):
    """With `paper` no jittered start is run, and the verdict says so."""
    report = verify(good_source, small_task, profile="policy", paper=True, judge=warm)
    assert report.passed
    assert report.provenance.paper
    assert [episode.name for episode in report.episodes] == ["nominal"]
    assert not any("jitter" in test for test in report.tests)


# What a controller may do instead of driving, and what its report must say.
HOSTILE = {
    "import error": ("import nosuchmodule\n", "ModuleNotFoundError at import"),
    "sys.exit": ("import sys\nsys.exit(0)\n", r"SystemExit at import .*line 2.*: 0"),
    "os._exit": ("import os\nos._exit(0)\n", "exit code 0 at import"),
    "os.abort": (
        "import os\nos.abort()\n",
        "crashed at import with SIG|SIGSYS|forbidden system call",
    ),
    "pytest.skip": (
        "import pytest\npytest.skip('x', allow_module_level=True)\n",
        "ModuleNotFoundError at import",
    ),
    "endless import": ("while True:\n    pass\n", r"import did not end within 1\.5 s"),
    "endless policy": (
        "def policy(obs):\n    while True:\n        pass\n",
        r"policy did not end within 1\.5 s",
    ),
    "endless reset": (
        "def reset(obs):\n    while True:\n        pass\n" + STILL,
        r"reset did not end within 1\.5 s",
    ),
    "slow policy": (
        "import time\n\n\ndef policy(obs):\n    time.sleep(0.11)\n    return 0, 0\n",
        r"policy takes 1\d\d ms a call, 50 ms are allowed",
    ),
    "fork bomb": (
        "import os\nwhile True:\n    os.fork()\n",
        "PermissionError|SIGSYS|forbidden|Operation not permitted",
    ),
    "subprocess": (
        "import subprocess\nsubprocess.run(['/bin/sh', '-c', 'sleep 100 &'])\n",
        "Error at import|SIGSYS|forbidden",
    ),
    "50 GB": (
        "import numpy as np\nx = np.ones(50 << 27)\n",
        "MemoryError at import|out of memory",
    ),
    "socket": (
        "import socket\nsocket.create_connection(('127.0.0.1', 9), timeout=1)\n",
        "Error at import|SIGSYS|forbidden",
    ),
    "print flood": (
        "while True:\n    print('x' * 10000)\n",
        "printed more than|did not end within",
    ),
    "kill the judge": (
        "import os\nos.kill(os.getppid(), 9)\nos.kill(-1, 9)\n",
        "at import",
    ),
    "judge's channel": (
        "import os\nfor fd in range(3, 20):\n    try:\n        os.write(fd, b'x')\n"
        "    except OSError:\n        print(fd)\n" + STILL,
        "channel|progress|did not end within",
    ),
    "recursion": ("def f():\n    f()\n\n\nf()\n", "RecursionError at import"),
    "no policy": ("X = 1\n", "has no attribute 'policy'|no `def policy"),
    "policy is no function": ("policy = 3\n", "not callable|no `def policy"),
    "reset raises": ("def reset(obs):\n    1 / 0\n\n\n" + STILL, "ZeroDivisionError"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_controllers_fail(small_task, quick, no_traces, name):
    """Each is reported as failed, soon and with its reason, and leaves no process."""
    source, reason = HOSTILE[name]
    began = time.monotonic()
    report = verify(source, small_task, profile="policy", limits=quick)
    assert time.monotonic() - began < 60
    assert not report.passed
    nominal = report.episodes[0]
    told = [nominal.error or "", *(f.message for f in report.failures)]
    assert re.search(reason, "\n".join(told)), told
    assert not nominal.progress_passed
    for text in told:
        assert "/tmp" not in text
        assert str(no_traces) not in text
        assert not re.search(r"0x[0-9a-f]{6}", text)


SPY = """
import os
import sensors

FOUND = [v for v in os.environ if "KEY" in v or "SECRET" in v]


def policy(obs):
    raise ValueError(f"found {len(FOUND)} and {list(os.environ)}")
"""


@pytest.mark.slow
def test_the_environment_holds_no_key(small_task, monkeypatch, no_traces):
    """A controller that looks for keys finds none, and fails for its import of os."""
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-secret")
    report = verify(SPY, small_task, profile="policy")
    assert not report.passed
    assert "found 0 and" in failed_with(report, "test_reaches_goal")
    assert "ANTHROPIC" not in report.model_dump_json()
    assert "import of 'os'" in failed_with(report, "test_imports")


FAKE = """

def run_episode(env, max_steps):
    points = [(30.0 + i, 30.0) for i in range(max_steps + 1)]
    return {"positions": points, "speeds": [20.0] * max_steps, "collisions": 0,
            "goal": (130.0, 30.0), "dt": 0.05}


def policy(obs):
    return 0.0, 0.0
"""


def test_a_fabricated_episode_fails(small_task, good_source, warm):
    """Invented positions count for nothing: no step was made, no progress, no goal."""
    source = good_source.replace('if __name__ == "__main__":', FAKE + "\n\nif False:")
    report = verify(source, small_task, paper=True, judge=warm)
    assert not report.passed
    for test in ("test_run_episode_schema", "test_progress", "test_reaches_goal"):
        assert report.tests[f"test_end_to_end.py::{test}"] == "failed"
    assert "after 0 steps" in failed_with(report, "test_run_episode_schema")
    assert report.episodes[0].d_min == pytest.approx(report.episodes[0].d0, abs=0.1)


@pytest.mark.parametrize(
    "answer",
    [
        "(float('nan'), 0.0)",
        "(float('inf'), 0.0)",
        "None",
        "'ab'",
        "((1, 1), (1, 1))",
        "(1.0, 1.0, 1.0)",
        "(True, False)",
        "{'left': 1, 'right': 1}",
        "(10 ** 400, 0)",
        "np.ones((2, 2))",
        "np.array(['a', 'b'])",
        "(1j, 0)",
        "object()",
    ],
)
def test_wrong_actions_are_refused(answer):
    """An action that is not two finite numbers is none, whatever else it is."""
    value = eval(answer, {"np": np})
    assert as_wheels(value) is None
    assert len(wrong_action(value)) < 200


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("answer", ["(float('nan'), 0.5)", "None"])
def test_wrong_actions_fail(small_task, answer, warm):
    """A policy with such an answer fails in its first step, and is told why."""
    source = f"def policy(obs):\n    return {answer}\n"
    report = verify(source, small_task, profile="policy", paper=True, judge=warm)
    assert not report.passed
    assert "policy must return two finite numbers" in report.episodes[0].error
    assert report.episodes[0].steps == 0


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "answer",
    [
        "np.array([left, right])",
        "np.float32(left), np.float64(right)",
        "[left, right]",
        "np.array([left, right], dtype=np.float16).astype(np.float32)",
    ],
)
def test_numpy_actions_are_fine(small_task, good_source, answer, warm):
    """Arrays, lists and NumPy numbers are as good as floats."""
    old = "return min(max(left, -1.0), 1.0), min(max(right, -1.0), 1.0)"
    assert old in good_source
    source = good_source.replace(old, f"return {answer}")
    report = verify(source, small_task, profile="policy", paper=True, judge=warm)
    assert report.passed, report.failures


FORGER = """
import gc
import numpy as np
import sensors


def policy(obs):
    obs["pose"][:] = obs["goal"][0], obs["goal"][1], 0.0
    for thing in gc.get_objects():
        if isinstance(thing, dict) and "pose" in thing:
            thing["pose"] = np.array([130.0, 30.0, 0.0], np.float32)
    np.hypot = lambda *a: np.zeros(1)
    return 0.0, 0.0
"""


def test_state_cannot_be_forged(small_task, warm):
    """Writing into observations or patching NumPy changes nothing at the judge's."""
    report = verify(FORGER, small_task, profile="policy", paper=True, judge=warm)
    assert not report.passed
    nominal = report.episodes[0]
    assert nominal.d_min == pytest.approx(nominal.d0, abs=0.1)


BROKEN = {
    "syntax error": (b"def policy(obs:\n", "does not parse: .*line 1"),
    "null bytes": (b"x = 1\0\n", "does not parse: .*null bytes"),
    "10 MB": (b"x = 1\n" * 1_700_000, "10200000 bytes, at most 200000 are allowed"),
    "not UTF-8": (b"# \xff\xfe\ndef policy(obs): ...\n", "does not parse: .*encoding"),
    "deep nesting": (b"x = " + b"(" * 3000 + b")" * 3000 + b"\n", "does not parse"),
    "empty": (b"", "no `def policy"),
    "no policy": (b"X = 1\n", "no `def policy"),
    "binary": (bytes(range(256)) * 4, "does not parse"),
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_fail(small_task, tmp_path, name, warm):
    """A file that is no controller fails with one clear line."""
    raw, reason = BROKEN[name]
    path = tmp_path / "controller.py"
    path.write_bytes(raw)
    report = verify(path, small_task, profile="policy", paper=True, judge=warm)
    assert not report.passed
    messages = [f.message for f in report.failures]
    assert any(re.search(reason, m) for m in messages), messages
    assert all("\n" not in m and len(m) < 500 for m in messages)
    assert report.episodes[0].steps == 0


def test_the_declared_encoding_is_what_is_checked(small_task, warm):
    """Code that a declared encoding hides from a reader does not escape the checks."""
    hidden = b"# coding: utf-7\n# +AAo-import os\n" + STILL.encode()
    report = verify(hidden, small_task, profile="policy", paper=True, judge=warm)
    assert "import of 'os'" in failed_with(report, "test_imports")


@pytest.mark.parametrize("what", ["missing.py", "\0", "", "/dev/zero"])
def test_files_that_cannot_be_read(what):
    """A missing or endless file is an error of the user, not of the controller."""
    with pytest.raises(ControllerFileError, match="controller"):
        read_source(what)


@pytest.mark.slow
def test_the_cpu_budget_is_for_all_episodes(small_task, good_source, no_traces):
    """What all processes of a controller use together is bounded."""
    burn = "\nimport time\n\nwhile time.process_time() < 0.8:\n    pass\n"
    source = good_source + burn
    limits = Limits(cpu_seconds=2)
    report = verify(source, small_task, profile="policy", limits=limits)
    assert not report.passed
    assert report.child_cpu_seconds < 8
    errors = [episode.error or "" for episode in report.episodes]
    assert any("limit of 2 s of CPU time" in error for error in errors), errors


COMMAND = ["-m", "tdac_agent", "verify"]
SCRIPT = """
import sys
from pathlib import Path
from tdac_agent import load_task, verify
from tdac_agent.verification.judge.warm import WarmJudge
with WarmJudge() as judge:
    source = Path(sys.argv[1]).read_bytes()
    verify(source, load_task(sys.argv[3]), judge=judge)
"""


def start_endless(folder, temporary, program=COMMAND):
    """`tdac verify` of a controller that does not end, once it is being imported."""
    task = write_small_task(folder / "task")
    path = folder / "controller.py"
    path.write_text("while True:\n    pass\n")
    process = subprocess.Popen(
        [sys.executable, *program, str(path), "--task", str(task)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    deadline = time.monotonic() + 60
    running = f"{temporary}/**/tdac-child-*/*/work/controller.py"
    # Unlike Path.glob it does not mind folders that go meanwhile.
    while not glob.glob(running, recursive=True) and time.monotonic() < deadline:
        time.sleep(0.02)
    return process


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_nothing(tmp_path, no_traces, number):
    """A signal in the middle of a verification ends the judge and its children."""
    process = start_endless(tmp_path, no_traces)
    process.send_signal(number)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert stderr.decode().strip().splitlines()[-1] == "interrupted"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the kernel of Linux sees to it")
@pytest.mark.parametrize("program", [COMMAND, ["-c", SCRIPT]], ids=["tdac", "script"])
def test_a_caller_that_is_killed_takes_all_with_it(
    tmp_path, no_traces, left_running, program
):
    """No process outlives it, though nobody ends them; folders stay."""
    process = start_endless(tmp_path, no_traces, program)
    process.kill()
    process.communicate(timeout=30)
    assert left_running(no_traces) == []
    for folder in no_traces.iterdir():
        shutil.rmtree(folder)


def test_the_report_is_json(small_task, warm):
    """Every figure of a report survives JSON, also of a controller that fails."""
    report = verify(
        "policy = 3\n", small_task, profile="policy", paper=True, judge=warm
    )
    again = Report.model_validate(json.loads(report.model_dump_json()))
    assert again == report


def test_each_message_names_its_test(small_task, warm):
    """Tests that fail for one reason share a heading, so the messages say whose they
    are; what is required stands in each of them, in units, and angles in degrees."""
    report = verify(STILL, small_task, profile="policy", judge=warm)
    text = shown(report)
    for line in (
        r"test_progress: not enough progress: in the first \d+ steps the path to the "
        r"goal must fall from \d+\.\d px to \d+\.\d px or less \(70%\); its smallest",
        r"test_reaches_goal: the robot must come within \d+ px of the goal in at most "
        r"\d+ steps; the episode ended after \d+ steps: out of time",
        r"heading in ° \[left right\]",
        r"grid path left, straight left: the smallest distance to the goal",
    ):
        assert re.search(line, text), line
    assert not re.search(r"\d rad\b|d_min|d0", text)
