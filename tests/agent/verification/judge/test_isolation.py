"""Nothing of one verification is left for the next, nor of one episode for another."""

import contextlib
import json
import os
import select
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small import QUICK, small_cells, write_small_task

from tdac_agent import load_task
from tdac_agent.errors import Fault
from tdac_agent.sandbox import Limits, available_tiers
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import load_trajectories, verify

TIMES = {"seconds", "child_cpu_seconds", "call_ms_mean", "call_ms_p99"}
# Tells all that a process can see of itself and around it, and that could be changed.
PROBE = """
import builtins
import decimal
import gc
import math
import os
import resource
import signal
import sys
import threading
import warnings
import zlib

import numpy as np
import sensors

SEEN = []


def look(name, action, *arguments):
    try:
        value = action(*arguments)
    except Exception as error:
        value = type(error).__name__
    text = repr(value)
    SEEN.append(f"{name} {text if len(text) < 130 else zlib.crc32(text.encode())}")


def is_open(number):
    try:
        return bool(os.fstat(number))
    except OSError:
        return False


def umask():
    return os.umask(0), os.umask(0o77)


def names(module):
    return sorted(name for name in vars(module) if name != "__warningregistry__")


def below(folder):
    return sorted(
        [name for name in os.listdir(folder) if not name.startswith("tdac-child-")]
    )


look("marks", lambda: [m.__name__ for m in list(sys.modules.values())
                       if hasattr(m, "mark")])
look("modules", lambda: sorted(sys.modules))
for module in (builtins, math, np, np.linalg, sensors, sys, os):
    look(module.__name__, names, module)
look("numpy", lambda: (np.hypot(3.0, 4.0), np.sum([1, 2]), np.pi, np.geterr()))
look("print options", np.get_printoptions)
look("builtins", lambda: (len([1]), abs(-1), sorted([2, 1]), round(0.5), max(1, 2)))
look("math", lambda: (math.pi, math.hypot(3, 4), math.atan2(0, -1)))
look("environment", lambda: sorted(os.environ))
look("limits", lambda: [
    resource.getrlimit(getattr(resource, name))
    for name in sorted(dir(resource))
    if name.startswith("RLIMIT")
])
look("descriptors", lambda: [n for n in range(64) if is_open(n)])
look("used", lambda: resource.getrusage(resource.RUSAGE_SELF).ru_utime < 3.0)
look("umask", umask)
look("work", lambda: below("."))
look("scratch", below, os.environ["TMPDIR"])
for place in ("/dev/shm", "/tmp", "/var/tmp", "/"):
    look("folder", below, place)
look("signals", lambda: [str(signal.getsignal(n)) for n in range(1, 65)
                         if n not in (9, 19, 32, 33)])
look("masked", lambda: sorted(signal.pthread_sigmask(0, [])))
look("timers", signal.getitimer, signal.ITIMER_REAL)
look("alarm", signal.alarm, 0)
look("nice", os.nice, 0)
# Which one an episode is on is a matter of chance.
look("processors", lambda: len(os.sched_getaffinity(0)))
look("threads", threading.active_count)
look("recursion", sys.getrecursionlimit)
look("switch", sys.getswitchinterval)
look("traces", lambda: (sys.gettrace(), sys.getprofile(), gc.isenabled()))
look("filters", lambda: len(warnings.filters))
look("decimal", lambda: decimal.getcontext().prec)


def policy(obs):
    raise ValueError("; ".join(SEEN))
"""
# Changes everything that it can, in its process and around it.
MARKS = """
import builtins
import gc
import math
import os
import random
import resource
import signal
import sys
import tempfile
import threading
import time

import numpy as np
import sensors

KEPT = []


def attempt(action, *arguments):
    try:
        KEPT.append(action(*arguments))
    except BaseException as error:
        return error


def write(folder):
    os.makedirs(folder, exist_ok=True)
    with open(f"{folder}/mark", "w") as file:
        file.write("mark")
    os.symlink("/", f"{folder}/link")


def leave_marks():
    for module in (builtins, math, np, np.linalg, sensors, sys, os):
        module.mark = "mark"
    sys.modules["mark"] = sys
    sys.path.insert(0, os.environ["TMPDIR"])
    np.hypot = np.sum = math.hypot = lambda *a, **k: 0.0
    builtins.len = builtins.abs = lambda *a: 0
    random.seed(0)
    np.random.seed(0)
    np.seterr(all="raise")
    np.set_printoptions(precision=1)
    os.environ["mark"] = os.environ["PYTHONPATH"] = "mark"
    places = [os.environ["TMPDIR"], ".", tempfile.gettempdir(), "/dev/shm", "/tmp"]
    for place in (*places, "/var/tmp", os.environ.get("HOME", "."), "/run"):
        attempt(write, place)
    attempt(np.save, "occupancy.npy", np.zeros((3, 3)))
    for name in dir(resource):
        if name.startswith("RLIMIT"):
            number = getattr(resource, name)
            attempt(resource.setrlimit, number, resource.getrlimit(number)[::-1])
    attempt(resource.setrlimit, resource.RLIMIT_FSIZE, (10, 10))
    for number in range(1, 65):
        attempt(signal.signal, number, signal.SIG_IGN)
    attempt(signal.pthread_sigmask, signal.SIG_BLOCK, range(1, 65))
    attempt(signal.setitimer, signal.ITIMER_REAL, 100)
    attempt(os.umask, 0)
    attempt(os.nice, 5)
    attempt(os.sched_setaffinity, 0, {max(os.sched_getaffinity(0))})
    attempt(os.chdir, os.environ["TMPDIR"])
    attempt(os.setsid)
    attempt(threading.Thread(target=time.sleep, args=(100,), daemon=True).start)
    attempt(os.fork)
    for _ in range(70):
        attempt(os.dup, 0)
        attempt(os.pipe)
    sys.setrecursionlimit(50_000)
    sys.setswitchinterval(1e-6)
    gc.disable()


def policy(obs):
    return 0.0, 0.0
"""
PATIENCE = replace(QUICK, import_seconds=10, call_seconds=10)
# What the first verification comes to, with its limits.
FIRST = {
    "marks at import": (MARKS + "\n\nleave_marks()\n", PATIENCE),
    "marks in an episode": (
        MARKS + "\n\ndef policy(obs):\n    leave_marks()\n    return 0.0, 0.0\n",
        PATIENCE,
    ),
    "a time-out": ("while True:\n    pass\n", replace(QUICK, import_seconds=0.5)),
    "all of the CPU time": (
        "def policy(obs):\n    while True:\n        pass\n",
        replace(QUICK, cpu_seconds=1, call_seconds=30),
    ),
    "a crash": ("import os\n\n\ndef policy(obs):\n    os.abort()\n", QUICK),
    "an exit": ("def policy(obs):\n    raise SystemExit\n", QUICK),
    "a kill": ("import os\nos.kill(0, 9)\nos.kill(os.getpid(), 9)\n", QUICK),
    "all of the memory": ("import numpy as np\nx = np.ones(50 << 27)\n", PATIENCE),
    "a stopped process": (
        "import os\nos.kill(os.getpid(), 19)\nwhile True:\n    pass\n",
        replace(QUICK, import_seconds=0.5),
    ),
    "a flood": ("while True:\n    print('x' * 10_000)\n", QUICK),
    "bytes on the channel": (
        "import os\nfor n in range(3, 64):\n    try:\n        os.write(n, b'x' * 99)\n"
        "    except OSError:\n        pass\n",
        QUICK,
    ),
    "closed descriptors": ("import os\nos.closerange(0, 64)\n", QUICK),
    "no Python": ("def policy(:\n", QUICK),
    "half a character": ("raise ValueError('\\ud800' * 9999)\n", QUICK),
}


ALWAYS = {"marks at import", "marks in an episode", "a time-out", "a crash"}


def often(names, always):
    """Parameters of which only some are tried in each run of the tests."""
    slow = pytest.mark.slow
    return [pytest.param(n, marks=[] if n in always else slow) for n in names]


def told(report):
    """All that a report says but for times."""

    def without_times(value):
        if isinstance(value, dict):
            return {k: without_times(v) for k, v in value.items() if k not in TIMES}
        return [without_times(v) for v in value] if isinstance(value, list) else value

    return without_times(json.loads(report.model_dump_json()))


def probe(task, judge):
    """What a controller sees that looks about and then raises."""
    report = verify(PROBE, task, profile="policy", paper=True, judge=judge)
    assert report.episodes[0].error.startswith("ValueError at policy"), report.episodes
    return told(report)


@pytest.fixture(scope="module")
def fresh_probe(small_task):
    """What the probe sees in a judge that has judged nothing else."""
    with WarmJudge() as judge:
        return probe(small_task, judge)


@pytest.mark.slow
def test_a_process_begins_without_traces(fresh_probe):
    """There is nothing in it but what the contract gives: no marks, no spare file."""
    seen = fresh_probe["episodes"][0]["error"].split("; ")
    work = ["controller.py", "occupancy.npy", "occupancy.png", "params.json"]
    assert f"work {[*work, 'robot.png', 'sensors.py', 'task.yaml']!r}" in seen
    assert {"threads 1", "scratch []", "alarm 0"} < set(seen)
    assert seen[0].endswith("marks []")
    assert seen[-1] == "decimal 28"  # the report has not cut it


@pytest.mark.slow
@pytest.mark.parametrize("name", often(FIRST, ALWAYS))
def test_a_verification_leaves_nothing_for_the_next(
    small_task, warm, fresh_probe, name
):
    """Whatever the first one does, the next report equals that of a fresh judge."""
    source, limits = FIRST[name]
    first = verify(
        source, small_task, profile="policy", paper=True, limits=limits, judge=warm
    )
    assert not first.passed
    assert probe(small_task, warm) == fresh_probe


def suite_of(folder, text):
    folder.mkdir(exist_ok=True)
    (folder / "test_mine.py").write_text(text)
    return folder


# What a suite does to the judge's own process.
SPOILERS = {
    "no Python": "def test_mine(:\n",
    "an import": "import nosuchmodule\n",
    "an exit": "import os\n\n\ndef test_mine():\n    os._exit(3)\n",
    "a kill": "import os\n\n\ndef test_mine():\n    os.kill(os.getpid(), 9)\n",
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", often(SPOILERS, {"an import", "a kill"}))
def test_a_fault_leaves_nothing_for_the_next(
    small_task, warm, fresh_probe, tmp_path, name
):
    """A suite that breaks its judge is a fault, and the next verdict is as ever."""
    suite = suite_of(tmp_path / "suite", SPOILERS[name])
    with pytest.raises(Fault):
        verify(PROBE, small_task, profile="policy", suite=suite, judge=warm)
    assert probe(small_task, warm) == fresh_probe


@pytest.mark.slow
def test_a_judge_that_takes_too_long_is_replaced(
    small_task, warm, fresh_probe, tmp_path, monkeypatch
):
    """A job over its time is ended as a fault; the next one has a new process."""
    text = "import threading\n\n\ndef test_mine():\n    threading.Event().wait()\n"
    suite = suite_of(tmp_path / "suite", text)
    monkeypatch.setattr("tdac_agent.verification.verify.DEADLINE_SECONDS", 3.0)
    with pytest.raises(Fault, match="did not answer within 3 s"):
        verify(PROBE, small_task, profile="policy", suite=suite, judge=warm)
    monkeypatch.undo()
    assert probe(small_task, warm) == fresh_probe


PATCHES = """
import builtins
import math
import os
import random

import gymnasium
import numpy as np

import tdac_agent.verification.judge.judge
import tdac_agent.verification.judge.report_log
import tdac_envs.map2d.env


def test_mine(task, controller):
    tdac_agent.verification.judge.judge.JITTERS = 0
    tdac_agent.verification.judge.report_log.PHASES = frozenset()
    tdac_envs.map2d.env.Map2DEnv.step = None
    tdac_agent.verification.judge.judge.Judge.rollout = None
    np.hypot = np.min = math.hypot = lambda *a, **k: 0.0
    np.random.seed(0)
    random.seed(0)
    os.environ["TDAC_MARK"] = "mark"
    os.umask(0)
    builtins.len = lambda value: 0
"""


def test_a_suite_leaves_nothing_for_the_next(small_task, warm, fresh_probe, tmp_path):
    """What a suite patches in the judge's process is gone with that process."""
    suite = suite_of(tmp_path / "suite", PATCHES)
    with contextlib.suppress(Fault):
        verify(PROBE, small_task, profile="policy", suite=suite, judge=warm)
    assert probe(small_task, warm) == fresh_probe


@pytest.fixture
def many(tmp_path, small_task, good_source):
    """Verifications that differ in one thing, each called with a judge."""
    path, suite = tmp_path / "controller.py", tmp_path / "suite"
    cells = small_cells()
    cells[80:100, 70:76] = True
    other_map = write_small_task(tmp_path / "map")
    np.save(other_map / "map.npy", cells)

    def run(judge, source=good_source, task=small_task, test="True", **options):
        path.write_text(source)
        suite_of(suite, f"def test_mine():\n    assert {test}\n")
        options = {"profile": "policy", "paper": True, "suite": suite} | options
        return told(verify(path, task, judge=judge, **options))

    def changed(**changes):
        return load_task(write_small_task(tmp_path / "task", **changes))

    return run, {
        "source": lambda: {"source": "def policy(obs):\n    return 0.5, 0.5\n"},
        "map": lambda: {"task": load_task(other_map)},
        "start": lambda: {"task": changed(start=[30, 40])},
        "horizon": lambda: {"task": changed(horizon=40)},
        "suite": lambda: {"test": "False"},
        "seed": lambda: {"paper": False, "seed": 1},
        "profile": lambda: {"profile": "paper"},
        "limits": lambda: {"limits": Limits(open_files=20, scratch_bytes=1 << 20)},
        "tier": lambda: {"tier": "rlimits"},
    }


CHANGES = ["source", "map", "start", "horizon", "suite"]
CHANGES += ["seed", "profile", "limits", "tier"]


@pytest.mark.slow
@pytest.mark.parametrize("change", often(CHANGES, {"source", "map"}))
def test_nothing_is_remembered_by_its_name(many, warm, change):
    """The same path, task name or suite with other content gets its own verdict."""
    run, variations = many
    other = variations[change]()
    usual = {"paper": other.get("paper", True)}
    first, second, third = run(warm, **usual), run(warm, **other), run(warm, **usual)
    with WarmJudge() as judge:
        alone = run(judge, **other)
    assert second == alone
    assert second != first
    assert third == first


@pytest.mark.slow
@pytest.mark.parametrize("known", ["this", "another"])
def test_what_was_read_ahead_changes_nothing(
    small_task, good_source, warm, known, tmp_path
):
    """A judge that has read this task or another one tells what one without does."""
    other = load_task(write_small_task(tmp_path, goal=[100.0, 30.0]))
    usual = verify(good_source, small_task, paper=True, judge=warm)
    with WarmJudge(task=small_task if known == "this" else other) as judge:
        assert told(verify(good_source, small_task, paper=True, judge=judge)) == told(
            usual
        )
    assert usual.passed


@pytest.mark.slow
def test_a_good_controller_is_judged_as_ever(small_task, good_source, tmp_path):
    """Its report, and each pose of each episode, are the same after all others."""
    seen = []
    with WarmJudge() as judge:
        for number, hostile in enumerate([None, "a crash", "marks at import"]):
            if hostile is not None:
                source, limits = FIRST[hostile]
                verify(source, small_task, limits=limits, paper=True, judge=judge)
            out = tmp_path / str(number)
            seen.append(told(verify(good_source, small_task, out=out, judge=judge)))
    assert seen[0]["verdict"]["passed"]
    assert seen[0] == seen[1] == seen[2]
    one, *others = (load_trajectories(tmp_path / n / "trajectories") for n in "012")
    assert list(one) == ["nominal", *(f"jitter {n}" for n in range(1, 6))]
    for other in others:
        for name, trajectory in one.items():
            for part in ("poses", "actions", "path_distances", "ranges"):
                old, new = getattr(trajectory, part), getattr(other[name], part)
                np.testing.assert_array_equal(old, new)


# Drives well, and leaves marks for other processes wherever it can.
STEADY_MARKS = """

import builtins
import os
import sys
import threading
import numpy

PLACES = [os.environ["TMPDIR"], ".", "/tmp", "/dev/shm", "/var/tmp"]
FOUND = [p for p in PLACES if os.path.exists(f"{p}/tdac-mark")]
FOUND += [m.__name__ for m in (builtins, os, sys, numpy) if hasattr(m, "tdac_mark")]
FOUND += [name for name in ("TDAC_MARK",) if name in os.environ]
FOUND += ["scratch"] * bool(os.listdir(os.environ["TMPDIR"]))
FOUND += ["threads"] * (threading.active_count() > 1)
honest, calls = policy, []


def leave(place):
    try:
        with open(f"{place}/tdac-mark", "w") as file:
            file.write("mark")
    except OSError as error:
        return error


def policy(obs):
    if FOUND:
        raise ValueError(f"found {FOUND}")
    calls.append(obs)
    if len(calls) == 3:
        for place in PLACES:
            leave(place)
        for module in (builtins, os, sys, numpy):
            module.tdac_mark = True
        os.environ["TDAC_MARK"] = "1"
    return honest(obs)
"""
TIERS = [s.tier.name for s in available_tiers() if s.works and s.tier.name != "rlimits"]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("tier", TIERS)
def test_an_episode_leaves_nothing_for_the_next(small_task, good_source, warm, tier):
    """Each of the six has a process and a scratch folder that nobody has used."""
    source = good_source + STEADY_MARKS
    report = verify(source, small_task, profile="policy", tier=tier, judge=warm)
    assert [e.error for e in report.episodes] == [None] * 6
    assert [e.outcome for e in report.episodes] == ["reached"] * 6
    assert {failure.group for failure in report.failures} == {"static"}  # its imports


def running(text):
    """Processes with a text in their environment, but for this one."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            ended = (folder / "stat").read_text().rpartition(")")[2].split()[0] in "ZX"
            environment = (folder / "environ").read_bytes()
            if not ended and os.fsencode(text) in environment:
                descriptors = len(list((folder / "fd").iterdir()))
                found[int(folder.name)] = descriptors
    return found


def when_calm(look, wanted=None, seconds=10.0):
    """What is seen when two looks agree, or agree with what is wanted."""
    deadline = time.monotonic() + seconds
    before = look()
    while time.monotonic() < deadline:
        select.select([], [], [], 0.2)
        now = look()
        if now == (before if wanted is None else wanted):
            return now
        before = now
    return before


@pytest.mark.slow
def test_nothing_piles_up(small_task, no_traces):
    """After many verifications as many processes, descriptors and folders as before."""

    def state():
        mine = len(os.listdir("/proc/self/fd")), threading.active_count()
        return mine, sorted(running(no_traces).values()), len(folders())

    def folders():
        return list(no_traces.glob("*/*"))

    options = {"profile": "policy", "paper": True}
    outside = len(os.listdir("/proc/self/fd")), threading.active_count()
    with WarmJudge() as judge:
        verify("x = 1\n", small_task, judge=judge, **options)
        once = when_calm(state)
        for source, limits in FIRST.values():
            verify(source, small_task, limits=limits, judge=judge, **options)
        assert when_calm(state, once) == once
        suite = suite_of(no_traces.parent / "suite", SPOILERS["a kill"])
        with pytest.raises(Fault):
            verify("x = 1\n", small_task, suite=suite, judge=judge, **options)
    assert (len(os.listdir("/proc/self/fd")), threading.active_count()) == outside
