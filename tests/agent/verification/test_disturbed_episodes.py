"""Robust verification: what an episode is, what is counted, what is said of it."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from driving import import_controller
from scipy.stats import binom
from small import QUICK

from tdac_agent.cli.play import drive_disturbed
from tdac_agent.errors import Fault
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.verification.episode_report import (
    EpisodeReport,
    badness,
    success_interval,
)
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.errors import TaskError

# After the good controller: what it does is decided by the heading it starts with.
MOODS = """

GOOD_RESET, GOOD_POLICY, MOOD = reset, policy, [""]


def mood(heading):
    if heading > 0.3:
        return "raise"
    if heading > 0.1:
        return "ram"
    return "spin" if heading < -0.3 else ""


def reset(obs):
    MOOD[0] = mood(float(obs["pose"][2]))
    if MOOD[0] == "raise":
        raise ValueError("not with this heading")
    GOOD_RESET(obs)


def policy(obs):
    if MOOD[0] == "ram":
        return 1.0, 1.0
    return (0.3, -0.3) if MOOD[0] == "spin" else GOOD_POLICY(obs)
"""


def expected_outcome(task, seed):
    """Of the controller with moods, from the environment's own draw."""
    env = task.make_env(**Disturbance().env_options())
    heading = float(env.reset(seed=seed)[0]["pose"][2])
    if heading > 0.3:
        return "error"
    if heading > 0.1:
        return "collision"
    return "out of time" if heading < -0.3 else "reached"


@pytest.fixture(scope="module")
def moody(small_task, good_source, warm):
    """The report of a controller that fails in each way."""
    return verify_episodes(good_source + MOODS, small_task, 16, first=0, judge=warm)


def test_an_episode_is_what_the_environment_draws(
    small_task, good_source, tmp_path, monkeypatch
):
    """The episode of a seed is that of `gym.make(…).reset(seed=…)`, to the last bit."""
    disturbance = Disturbance(motor_lag=0.04)
    options = disturbance.env_options()
    source = good_source.encode()
    judged = drive_disturbed(small_task, source, 7, disturbance, "auto").rollout
    env = gym.make("tdac_envs:TDAC-Map2D-v0", **small_task.env_kwargs(), **options)
    module = import_controller(good_source, env.unwrapped, tmp_path, monkeypatch)
    observation, _ = env.reset(seed=7)
    poses, ended = [env.unwrapped.pose()], False
    module.reset(observation)
    while not ended:
        action = np.array(module.policy(observation), np.float32)
        observation, _, terminated, truncated, info = env.step(action)
        poses.append(env.unwrapped.pose())
        ended = terminated or truncated
    assert judged.reached == info["is_success"]
    assert judged.trajectory.steps > 20
    assert np.array_equal(judged.trajectory.poses, np.array(poses))


@pytest.mark.slow
def test_play_replays_what_was_counted(small_task, good_source, moody):
    """Whatever became of a seed, playing it gives the same figures again."""
    source = (good_source + MOODS).encode()
    for episode in moody.worst[:: len(moody.worst) // 5]:
        seed, usual = episode.seed, Disturbance()
        driven = drive_disturbed(small_task, source, seed, usual, "auto")
        spent = {"cpu_seconds": episode.cpu_seconds}
        assert driven.row.model_copy(update=spent) == episode


@pytest.mark.slow
def test_each_way_to_fail_is_counted(small_task, moody):
    """Outcomes, successes and failed seeds are those of the starts that were drawn."""
    wanted = {seed: expected_outcome(small_task, seed) for seed in range(16)}
    assert set(wanted.values()) == {"reached", "collision", "out of time", "error"}
    failed = tuple(s for s, o in wanted.items() if o != "reached")
    assert tuple(each.seed for each in moody.failures) == failed
    assert moody.successes == list(wanted.values()).count("reached")
    assert moody.count == sum(moody.outcomes.values()) == 16
    for outcome, count in moody.outcomes.items():
        assert count == list(wanted.values()).count(outcome)
    assert moody.rate == moody.successes / 16
    assert moody.interval == success_interval(moody.successes, 16)


def test_the_worst_come_first(moody):
    """Failures by the share of the way left, then successes by their steps."""
    failures = [e for e in moody.worst if not e.success]
    assert [e.seed for e in moody.worst[: len(failures)]] == [e.seed for e in failures]
    left = [e.d_min / e.d0 for e in failures]
    assert left == sorted(left, reverse=True)
    steps = [e.steps for e in moody.worst[len(failures) :]]
    assert steps == sorted(steps, reverse=True)
    assert {e.cause for e in failures} == {"error", "spinning", "collision"}
    for episode in failures:
        assert episode.x is not None
        assert episode.step is not None
    error = next(e.error for e in failures if e.outcome == "error")
    assert re.search(r"ValueError at reset .*not with this heading", error)


def test_a_seed_stands_for_itself(small_task, good_source, moody, warm):
    """An episode is the same whichever others are run with it."""
    source = good_source + MOODS
    part = verify_episodes(source, small_task, 5, first=9, judge=warm)
    whole = {e.seed: e for e in moody.worst}
    for episode in part.worst:
        assert (
            episode.model_copy(update={"cpu_seconds": whole[episode.seed].cpu_seconds})
            == whole[episode.seed]
        )
    assert sorted(e.seed for e in part.worst) == [9, 10, 11, 12, 13]


@pytest.mark.slow
def test_disturbance_is_what_makes_the_difference(small_task, good_source):
    """Each part of it changes the way that is driven, from the same start."""
    none = Disturbance(range_noise=0.0, wheel_slip=0.0, motor_lag=0.0, delay=0)
    parts = [
        none,
        Disturbance(0.1, 0.0, 0.0, 0),
        Disturbance(0.0, 0.1, 0.0, 0),
        Disturbance(0.0, 0.0, 0.1, 0),
        Disturbance(0.0, 0.0, 0.0, 1),
    ]
    driven = [
        drive_disturbed(small_task, good_source.encode(), 3, part, "auto").rollout
        for part in parts
    ]
    driven = [rollout.trajectory for rollout in driven]
    assert len({t.poses[0].tobytes() for t in driven}) == 1
    seen = {t.poses.tobytes() + t.ranges.tobytes() for t in driven}
    assert len(seen) == len(parts)


def test_a_sequential_test_sees_the_seeds_in_order(
    small_task, good_source, moody, warm
):
    """It stops where the outcomes, one seed after the other, decide; no later."""
    test = SequentialTest(0.9, 16, margin=0.4)
    counts = [0, 0]
    for seed in range(16):
        counts[seed in {each.seed for each in moody.failures}] += 1
        if test.decide(*counts) != "undecided":
            break
    report = verify_episodes(
        good_source + MOODS,
        small_task,
        16,
        first=0,
        accept_at=0.9,
        margin=0.4,
        judge=warm,
    )
    assert report.count == sum(counts) < 16
    assert report.successes == counts[0]
    assert report.sequential.decision == test.decide(*counts) == "rejected"
    assert report.sequential.at_refused_rate == test.characteristics(0.5)
    assert report.rate is report.interval is None
    assert not report.passed


@pytest.mark.slow
def test_a_good_controller_is_accepted(small_task, good_source, warm):
    """As soon as its successes suffice."""
    report = verify_episodes(
        good_source, small_task, 100, accept_at=0.9, margin=0.4, judge=warm
    )
    assert report.passed
    assert report.count == report.successes
    assert report.count == report.sequential.test.fewest_to_accept


FORGETS = """

FIRST = [True]
import tempfile
from pathlib import Path


def reset(obs):
    left = list(Path(tempfile.gettempdir()).iterdir())
    if left or not FIRST[0]:
        raise ValueError(f"somebody was here: {left}")
    FIRST[0] = False
    (Path(tempfile.gettempdir()) / "note").write_text("was here")


def policy(obs):
    return 1.0, 1.0
"""


def test_no_episode_knows_of_another(small_task, warm):
    """Each has a fresh process and an empty scratch folder."""
    report = verify_episodes(FORGETS, small_task, 5, judge=warm)
    assert report.outcomes == {"collision": 5}


BURNS = """

import time


def reset(obs):
    while time.process_time() < 0.6:
        pass


def policy(obs):
    return 1.0, 1.0
"""


@pytest.mark.slow
def test_cpu_time_is_limited_for_each_episode(small_task, warm):
    """All together may use more than that."""
    limits = Limits(cpu_seconds=2, reset_seconds=60)
    report = verify_episodes(BURNS, small_task, 5, limits=limits, judge=warm)
    assert report.outcomes == {"collision": 5}
    assert report.child_cpu_seconds > limits.cpu_seconds
    endless = BURNS.replace("0.6", "60.0")
    report = verify_episodes(endless, small_task, 1, limits=limits, judge=warm)
    assert report.worst[0].cause == "time-out"
    assert "CPU time" in report.worst[0].error


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import nosuchmodule\n", "ModuleNotFoundError at import"),
        ("def policy(obs):\n    while True:\n        pass\n", "did not end within"),
        ("def policy(obs):\n    return 1.0\n", "two finite numbers"),
        ("x = 1\n", "policy"),
    ],
    ids=["no import", "endless", "no action", "no policy"],
)
def test_a_broken_controller_is_a_report(small_task, warm, source, reason):
    """Its episodes are failures, with the reason, and no exception."""
    report = verify_episodes(source, small_task, 2, limits=QUICK, judge=warm)
    assert report.successes == 0
    assert report.outcomes == {"error": 2}
    assert all(re.search(reason, episode.error) for episode in report.worst)
    assert report.interval.low == 0.0
    assert report.time_outs == (2 if reason == "did not end within" else 0)


def test_a_broken_sandbox_is_a_fault(small_task, good_source, warm):
    """Neither a success nor a failure."""
    with pytest.raises(Fault, match="nosuch"):
        verify_episodes(good_source, small_task, 2, tier="nosuch", judge=warm)


def test_evidence_is_kept_and_watched(small_task, good_source, tmp_path, warm):
    """`robust.json` reads back as it was; who watches sees the numbers grow."""
    seen = []
    report = verify_episodes(
        good_source,
        small_task,
        6,
        out=tmp_path / "new",
        judge=warm,
        watch=lambda *counts: seen.append(counts),
    )
    text = (tmp_path / "new" / "episodes.json").read_text()
    assert EpisodeReport.model_validate_json(text) == report
    assert seen == sorted(seen)
    assert seen[-1] == (6, report.successes)
    assert report.provenance.disturbance == Disturbance()
    assert report.provenance.sha256 == small_task.sha256()


@pytest.mark.parametrize(
    ("episodes", "arguments"),
    [(0, {}), (5, {"first": -1}), (5, {"accept_at": 0.9}), (5.5, {})],
)
def test_numbers_that_make_no_sense(small_task, warm, episodes, arguments):
    """Refused before anything is run."""
    with pytest.raises(TaskError, match=r"expected|at least"):
        verify_episodes("x = 1\n", small_task, episodes, judge=warm, **arguments)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("range_noise", -0.1),
        ("range_noise", 1.5),
        ("wheel_slip", float("nan")),
        ("motor_lag", float("inf")),
        ("delay", -1),
        ("delay", 0.5),
        ("delay", 100_000),
    ],
)
def test_disturbances_that_make_no_sense(field, value):
    """Each is refused by its name."""
    with pytest.raises(TaskError, match=field.replace("_", " ")):
        Disturbance(**{field: value})


@pytest.mark.parametrize("episodes", [1, 10, 50])
def test_the_interval_covers(episodes):
    """For every rate it holds the true one with 95 % or more: summed exactly."""
    intervals = [success_interval(k, episodes) for k in range(episodes + 1)]
    low = np.array([interval.low for interval in intervals])
    high = np.array([interval.high for interval in intervals])
    counts = np.arange(episodes + 1)
    for rate in np.linspace(0.0, 1.0, 401):
        holds = (low <= rate) & (rate <= high)
        assert binom.pmf(counts, episodes, rate)[holds].sum() >= 0.95 - 1e-12


def test_the_interval_is_no_wider_than_needed():
    """At its ends, what was seen or more extreme has a probability of 2.5 %."""
    for successes in range(1, 50):
        interval = success_interval(successes, 50)
        assert binom.sf(successes - 1, 50, interval.low) == pytest.approx(0.025)
        assert binom.cdf(successes, 50, interval.high) == pytest.approx(0.025)
    assert success_interval(0, 50).low == 0.0
    assert success_interval(50, 50).high == 1.0


def test_a_contact_is_no_success():
    """Not even where the goal was reached as well; it is sorted as a failure."""
    figures_ = {"seed": 1, "steps": 9, "d0": 50.0, "d_min": 2.0, "cpu_seconds": 0.1}
    clean = EpisodeRow(outcome="reached", collisions=0, **figures_)
    touched = EpisodeRow(outcome="reached", collisions=1, **figures_)
    assert clean.success
    assert not touched.success
    assert badness(touched) < badness(clean)


@pytest.mark.slow
def test_a_hundred_episodes(small_task, good_source, warm):
    """The built-in controller is not disturbed by what is usual."""
    report = verify_episodes(good_source, small_task, 100, first=0, judge=warm)
    assert report.count == 100
    assert report.successes >= 95
    assert report.interval.low < report.rate <= report.interval.high
    assert len(report.worst) == 20


def printed_command(out, name):
    """The words after `tdac` in the line of what was printed that names it."""
    line = next(line for line in out.splitlines() if f"tdac {name}" in line)
    return shlex.split(line.partition(f"tdac {name}")[2])


@pytest.mark.slow
def test_the_printed_command_replays(done, good):
    """What `verify --robust` prints plays the very episode."""
    noise = ["--wheel-slip", "0.0345678901", "--delay", "1"]
    words = ["verify", good, "--profile", "policy", "--robust", 6, *noise]
    out = done(*words)
    row = re.search(r"│ +(\d+) │ reached +│ +(\d+) │", out)
    assert "success rate 100.0 %, 95 % interval 54.1 % to 100.0 %" in out
    again = printed_command(out, "play")
    assert again == [str(good), *noise, "--seed", row[1]]
    out = done("play", *again, "--video", "a.gif")
    assert f"seed {row[1]}: reached after {row[2]} steps" in out


@pytest.mark.slow
def test_the_episode_of_a_suite_is_played_by_its_name(done, good):
    """`--episode` takes what the report calls it, and no other word."""
    out = done("play", good, "--episode", "jitter 2", "--video", "a.gif")
    assert "jitter 2: reached after" in out


@pytest.mark.slow
def test_robust_json(tdac, good):
    """One object on stdout, with both reports, and in `--out` a file of each."""
    words = ["verify", good, "--profile", "policy", "--robust", 3, "--json"]
    code, out, _ = tdac(*words, "--first-seed", 40, "--out", "kept")
    content = json.loads(out)
    assert code == 0
    assert content["verdict"]["passed"]
    report = EpisodeReport.model_validate(content["robust"])
    assert report.provenance.first == 40
    assert sorted(episode.seed for episode in report.worst) == [40, 41, 42]
    kept = Path("kept", "episodes.json").read_text()
    assert EpisodeReport.model_validate_json(kept) == report
    assert Path("kept", "report.json").is_file()


@pytest.mark.slow
def test_what_is_not_verified_is_not_disturbed(rejected, good):
    """Exit 1, and it says so."""
    (good / "controller.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    words = ["verify", good, "--profile", "policy", "--robust", 3]
    out = rejected(*words)
    assert "robustness not measured: the controller failed its tests" in out
    out = rejected(*words, "--json")
    assert json.loads(out)["robust"] is None


@pytest.mark.slow
def test_the_decision_is_the_exit_code(rejected, done, good):
    """A verified controller that is rejected when it is disturbed: exit 1."""
    words = ["verify", good, "--profile", "policy", "--robust", 30]
    words += ["--accept-at", 0.9, "--margin", 0.4]
    out = done(*words)
    assert "accepted at 90.0 % after" in out
    out = rejected(*words, "--delay", 40, "--wheel-slip", 0.9)
    assert "rejected at 90.0 % after 2 of at most 30 episodes" in out
    assert "a true rate of 50.0 % is accepted with probability" in out
    assert "far better than one of 50.0 %" in " ".join(out.split())
    assert "interval" not in out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["verify", "--robust", "0"], "robust"),
        (["verify", "--delay", "1"], "--delay needs -n N"),
        (["verify", "--accept-at", "0.9"], "--accept-at needs -n N"),
        (["verify", "--robust", "9", "--margin", "0.1"], "--margin needs --accept-at"),
        (["verify", "--robust", "9", "--accept-at", "0.9"], "at least 52 episodes"),
        (["verify", "--robust", "99", "--accept-at", "1"], "below 1"),
        (["verify", "--robust", "9", "--range-noise", "-1"], "range noise"),
        (["verify", "--robust", "9", "--delay", "5000"], "delay of at most"),
        (["verify", "--robust", "9", "--first-seed", "-1"], "first-seed"),
        (["play", "--delay", "1"], "--delay needs --seed"),
        (["play", "--seed", "1", "--episode", "nominal"], "not both"),
        (["play", "--seed", "1", "--wheel-slip", "nan"], "--wheel-slip must be finite"),
        (["play", "--episode", "jitter 9"], "expected one of nominal, jitter 1"),
    ],
    ids=" ".join,
)
def test_wrong_words(refused, good, words, reason):
    """Flags that contradict each other, or make no sense: one clear line, exit 2."""
    command, *flags = words
    film = ["--video", "a.gif"] if command == "play" else []
    err = refused(command, good, *flags, *film)
    assert err.startswith("error: ")
    assert re.search(reason, err), err


@pytest.mark.slow
def test_an_interrupt_leaves_nothing(good, no_traces):
    """Ctrl-C between disturbed episodes: exit 130, no process, no file."""
    kept = good / "kept"
    kept.mkdir()
    (kept / "episodes.json").write_text("of an earlier controller")
    words = ["verify", str(good), "--profile", "policy", "--robust", "5000"]
    words += ["--out", str(kept)]
    process = subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *words],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(no_traces)},
    )
    deadline = time.monotonic() + 120
    while not _begun(no_traces) and time.monotonic() < deadline:
        os.sched_yield()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.decode().strip().splitlines()[-1] == "interrupted"
    told = r"after \d+ of 5000 disturbed episodes, \d+ failed; no success rate computed"
    assert re.search(f"^interrupted {told}$", out.decode(), re.MULTILINE)
    assert (
        f"{kept} contains the report of the suite, but no episodes.json" in out.decode()
    )
    assert (kept / "report.json").is_file()
    assert not (kept / "episodes.json").exists()


def _begun(folder):
    """Whether some disturbed episodes have ended."""
    files = list(folder.glob("tdac-drive-*/results/episodes.jsonl"))
    return files and files[0].read_bytes().count(b"\n") >= 2
