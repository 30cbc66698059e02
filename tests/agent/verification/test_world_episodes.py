"""The judge on a task set: fresh worlds, nothing told, scores that are right."""

import hashlib
import json
import math
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from few_worlds import write_set, write_short_set
from script import STILL

import tdac_agent
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.episode_report import EpisodeReport, clock_dependence
from tdac_agent.verification.judge.set_checks import static_checks
from tdac_agent.verification.judge.set_files import level_params, write_files
from tdac_agent.verification.ledger import user_ledger
from tdac_agent.verification.verify_episodes import part_of_set, verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.env import LadderEnv
from tdac_envs.ladder.set_file import set_names

LEVELS = Path(tdac_agent.__file__).parent / "builtin" / "levels"
KNOWN = LEVELS / "known.py"
GENERATORS = ("aisles", "clutter")
SALT = b"a salt of enough bytes"


@pytest.fixture
def set_yaml(tmp_path):
    """Writes a set of small worlds with these values, and loads it."""

    def load(**values):
        return load_set(write_short_set(tmp_path / "few.yaml", **values))

    return load


@pytest.mark.parametrize("name", set_names())
def test_neither_bound_is_crossed_by_more_than_one_in_twenty(name):
    """Arrivals and contacts, each at the rate that must not be accepted."""
    _, test = part_of_set(load_set(name), "test", None)
    for one in (test, test.contact):
        assert one.characteristics(one.refuse_at).accepted <= 0.05
    assert test.contact.refuse_at == pytest.approx(0.95)


def test_too_few_worlds_for_a_verdict():
    """One line says so, and what can be asked instead."""
    with pytest.raises(TaskError, match=r"barn has too few worlds .* -n 50 asks"):
        part_of_set(load_set("barn"), "test", None)
    assert part_of_set(load_set("barn"), "test", 50)[1] is None


def test_a_good_controller(warm, tmp_path):
    """Its scores are those of its trajectories."""
    worlds = [{"name": each, "width": 130, "height": 110} for each in GENERATORS]
    tasks = load_set(write_set(tmp_path / "two.yaml", worlds=worlds))
    report = verify_episodes(KNOWN, tasks, 5, split="dev", judge=warm, out=tmp_path)
    assert (report.count, report.successes) == (5, 5)
    assert report.told == ()
    assert set(report.by_generator) == set(GENERATORS)
    assert report.scores.success == 1.0
    assert 0.6 < report.scores.time < 1.0
    for episode in report.episodes:
        world = tasks.world("dev", episode.index)
        run = Trajectory.load(tmp_path / "trajectories" / f"{episode.index}.npz")
        assert np.allclose(run.poses[0], world.start)
        gap = np.hypot(*(run.poses[-1][:2] - world.goal))
        assert gap <= tasks.file.goal_tolerance + 1e-6
        assert episode.steps == run.steps
        assert episode.time_score == world.difficulty.steps / run.steps
        driven = np.hypot(*np.diff(run.poses[:, :2], axis=0).T).sum()
        assert episode.path_score == pytest.approx(
            min(world.difficulty.length / driven, 1.0)
        )
    kept = EpisodeReport.model_validate_json((tmp_path / "episodes.json").read_text())
    assert kept == report


def test_the_controller_sees_what_the_level_says(warm, set_yaml):
    """It fails if there is anything else, in its observations or its folder."""
    source = """
import random
os = getattr(random, "_" + "os")  # the static tests are easily deceived
def reset(obs):
    assert sorted(obs) == ["goal", "odometry", "ranges", "wheel_speeds"], sorted(obs)
    assert sorted(os.listdir(".")) == ["controller.py", "params.json"], os.listdir(".")
def policy(obs):
    assert len(obs) == 4
    return 0.0, 0.0
"""
    tasks = set_yaml(observed=["goal", "odometry", "ranges", "wheel_speeds"])
    report = verify_episodes(source, tasks, 2, split="dev", judge=warm)
    assert [episode.error for episode in report.episodes] == [None, None]
    assert report.causes == {"standing still": 2} or sum(report.causes.values()) == 2


@pytest.mark.parametrize("name", set_names())
def test_folders_of_two_worlds_differ_by_the_map_alone(name, tmp_path):
    tasks, folders = load_set(name), []
    for number in range(2):
        folders.append(tmp_path / str(number))
        folders[-1].mkdir()
        write_files(folders[-1], tasks.file, tasks.task("dev", number))
    files = [{path.name: path for path in folder.iterdir()} for folder in folders]
    expected = {"params.json"} | ({"occupancy.npy"} if tasks.file.map else set())
    assert files[0].keys() == files[1].keys() == expected
    for path in (*files[0].values(), *files[1].values()):
        assert path.stat().st_mtime == 0
    texts = [each["params.json"].read_bytes() for each in files]
    assert texts[0] == texts[1]
    told = json.loads(texts[0])
    assert told == level_params(tasks.file)
    assert not {"start", "goal", "source", "name", "split", "index"} & set(told)
    if tasks.file.map:
        cells = np.load(files[0]["occupancy.npy"])
        assert np.array_equal(cells, tasks.task("dev", 0).terrain.grid.cells)


@pytest.mark.slow_after(3)
@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("def policy(obs:\n", ["test_source_parses: the source does not parse: "]),
        ("import os\n" + STILL, ["test_imports: line 1: import of 'os'; allowed"]),
        (
            "def reset(obs):\n    pass\n",
            [
                "test_policy_is_defined: no `def policy(obs)` at the top level",
                "test_short_rollout_is_stable[10]: AttributeError at policy",
            ],
        ),
        (
            "def policy(obs):\n    return 1.0,\n",
            ["test_short_rollout_is_stable[10]: policy must return two finite"],
        ),
        (
            "def policy(obs):\n    return float('nan'), 0.0\n",
            ["test_short_rollout_is_stable[10]: policy must return two finite"],
        ),
        (
            "def policy(obs):\n    open('/etc/passwd')\n    return 0.0, 0.0\n",
            ["test_short_rollout_is_stable[10]: FileNotFoundError at policy (line 2)"],
        ),
        ("1 / 0\n" + STILL, ["test_short_rollout_is_stable[10]: ZeroDivisionError"]),
        (
            "def policy(obs):\n    return 0.0, eval('0.0')\n",
            ["test_hygiene[forbidden_calls]: forbidden calls: line 2: "],
        ),
    ],
)
def test_a_file_that_fails_the_tests_is_not_driven(warm, set_yaml, source, lines):
    """Each failed test is told once, also for hidden worlds, which it never saw."""
    report = verify_episodes(source.encode(), set_yaml(), 3, split="dev", judge=warm)
    assert (report.count, report.episodes, report.scores) == (0, (), None)
    assert report.refused
    assert not report.passed
    assert len(report.told) == len(lines)
    for text, line in zip(report.told, lines, strict=True):
        assert text.startswith(line)
    failed = [name for name, outcome in report.tests.items() if outcome == "failed"]
    assert failed == [line.partition(":")[0] for line in lines]


def test_a_refused_file_is_no_hidden_evaluation(warm, set_yaml, tmp_path):
    """It can be judged on the same salt when it is mended; both are in the ledger."""
    salt = tmp_path / "secret.salt"
    salt.write_bytes(b"a fifth salt of enough bytes")
    given = {"salt_file": salt, "judge": warm}
    tasks = set_yaml()
    wrong = verify_episodes("import os\n" + STILL, tasks, 2, split="hidden", **given)
    assert (wrong.count, wrong.hidden) == (0, None)
    assert "import of 'os'" in wrong.told[0]


def test_diagnoses_are_in_the_frame_of_the_controller(warm, set_yaml, tmp_path):
    """Without a map, places and headings are from the start, as `pose` is."""
    source = """
poses = []
def policy(obs):
    poses.append(obs["pose"])
    return 1.0, 0.9
"""
    tasks = set_yaml()
    report = verify_episodes(source, tasks, 2, split="dev", judge=warm, out=tmp_path)
    for episode in report.episodes:
        run = Trajectory.load(tmp_path / "trajectories" / f"{episode.index}.npz")
        env = LadderEnv(tmp_path / "few.yaml", "dev")
        seen, _ = env.reset(options={"index": episode.index})
        for action in run.actions:
            seen = env.step(action)[0]
        x, y, heading = seen["pose"].tolist()
        # The last steps of an episode end in its last pose.
        last = episode.text.rpartition("; ")[2]
        assert last.partition(": ")[2] == (
            f"{x:z.1f} {y:z.1f} {math.degrees(heading):z.0f}."
        )
        far = np.hypot(x, y)
        assert far < 40, "the start of a map is further from its corner"


def test_failures_are_counted_and_three_are_told(warm, set_yaml):
    report = verify_episodes(STILL, set_yaml(), 5, split="dev", judge=warm)
    assert (report.successes, len(report.told), len(report.episodes)) == (0, 3, 5)
    assert sum(report.causes.values()) == 5
    assert report.told[0].startswith("world 0: ")
    assert report.scores.model_dump() == {
        "success": 0.0,
        "time": 0.0,
        "path": 0.0,
        "barn": 0.0,
    }


@pytest.mark.slow
@pytest.mark.parametrize("level", ["unknown", "lost"])
def test_the_built_in_controllers_without_a_map(warm, level):
    """They pass the tests, and reach most goals within the CPU budget."""
    file = LEVELS / f"{level}.py"
    report = verify_episodes(file, load_set(level), 10, split="dev", judge=warm)
    assert report.count == 10
    assert report.successes >= 8
    assert report.scores.time > 0.4


@pytest.mark.parametrize(
    "file", sorted(LEVELS.glob("*.py")), ids=lambda file: file.stem
)
def test_built_in_controllers_pass_the_static_tests(file):
    assert set(static_checks(file.read_bytes()).values()) == {None}


def test_hidden_worlds_are_told_in_sums_alone(warm, set_yaml, tmp_path):
    """Their rows are sealed: only this user can open them, and they have no text."""
    salt = tmp_path / "secret.salt"
    salt.write_bytes(SALT)
    tasks = set_yaml()
    given = {"salt_file": salt, "judge": warm, "out": tmp_path / "out"}
    report = verify_episodes(STILL, tasks, 3, split="hidden", **given)
    assert (report.count, report.successes) == (3, 0)
    assert report.episodes == ()
    assert report.told == ()
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["episodes.json", "episodes.mark", "sealed"]
    text = (tmp_path / "out" / "episodes.json").read_text()
    assert SALT.decode() not in text
    assert SALT.hex() not in text
    assert not {"sealed", "trajectories"} & set(json.loads(text))
    (rows,) = (tmp_path / "out" / "sealed").glob("*.jsonl")
    assert stat.S_IMODE(rows.parent.stat().st_mode) == 0o700
    figures = [json.loads(line) for line in rows.read_text().splitlines()]
    assert [each["index"] for each in figures] == [0, 1, 2]
    assert {each["text"] for each in figures} == {None}


@pytest.mark.slow
def test_a_hidden_evaluation_is_driven_once(warm, set_yaml, tmp_path):
    """The same file, set, salt and number are answered from the ledger."""
    salt, driven = tmp_path / "secret.salt", []
    salt.write_bytes(b"a third salt of enough bytes")
    given = {"salt_file": salt, "judge": warm}
    tasks = set_yaml()

    def watch(episodes, successes):
        driven.append(episodes)

    source = STILL + "# driven once\n"
    first = verify_episodes(source, tasks, 2, split="hidden", watch=watch, **given)
    assert (first.hidden.number, first.hidden.count) == (1, 1)
    assert first.hidden.recorded is None
    assert driven[-1] == 2
    driven.clear()
    again = verify_episodes(source, tasks, 2, split="hidden", watch=watch, **given)
    assert driven == []
    assert again.hidden.recorded is not None
    same = {"hidden": first.hidden}
    same_text = again.model_copy(update=same).model_dump_json()
    assert same_text == first.model_dump_json()
    more = verify_episodes(source, tasks, 3, split="hidden", **given)
    assert (more.hidden.number, more.hidden.count, more.count) == (2, 2, 3)
    other = verify_episodes(source + "# other\n", tasks, 2, split="hidden", **given)
    assert (other.hidden.number, other.hidden.count) == (1, 1)


@pytest.mark.slow
def test_the_ledger_is_written_before_hidden_worlds_are_driven(
    warm, set_yaml, tmp_path
):
    """An interrupt leaves the evaluation in it."""
    salt = tmp_path / "secret.salt"
    salt.write_bytes(b"a fourth salt of enough bytes")
    given = {"salt_file": salt, "judge": warm}

    def interrupt(episodes, successes):
        raise KeyboardInterrupt

    source = STILL + "# interrupted\n"
    with pytest.raises(KeyboardInterrupt):
        verify_episodes(source, set_yaml(), 2, split="hidden", watch=interrupt, **given)
    last = json.loads(user_ledger().path.read_text().splitlines()[-1])
    assert last["event"] == "begun"
    assert last["about"]["worlds"] == 2
    assert last["about"]["salt_sha256"] == hashlib.sha256(salt.read_bytes()).hexdigest()
    resumed = verify_episodes(source, set_yaml(), 2, split="hidden", **given)
    assert (resumed.count, resumed.hidden.count) == (2, 1)


def test_a_salt_that_controllers_could_read_is_refused(set_yaml):
    salt = Path(json.__file__).with_name("scanner.py")
    with pytest.raises(TaskError, match="controllers can read this folder"):
        verify_episodes(STILL, set_yaml(), 1, split="hidden", salt_file=salt)


def test_hidden_worlds_need_walls(set_yaml, tmp_path):
    salt = tmp_path / "secret.salt"
    salt.write_bytes(SALT)
    with pytest.raises(TaskError, match="'rlimits' cannot keep a controller from"):
        verify_episodes(
            STILL, set_yaml(), 1, split="hidden", salt_file=salt, tier="rlimits"
        )


@pytest.mark.slow
def test_too_much_cpu_time_is_a_failure(warm, set_yaml):
    source = """
import time
def policy(obs):
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass
    return 0.0, 0.0
"""
    tasks = set_yaml(cpu={"start": 5.0, "step": 0.01, "bank": 0.1})
    report = verify_episodes(source, tasks, 1, split="dev", judge=warm)
    (episode,) = report.episodes
    assert episode.outcome == "error"
    assert "s of CPU time for 10 steps; 0.20 s are allowed" in episode.error
    roomy = set_yaml(cpu={"start": 5.0, "step": 0.2, "bank": 0.1})
    report = verify_episodes(source, roomy, 1, split="dev", judge=warm)
    assert report.episodes[0].outcome == "out of time"


@pytest.mark.slow
def test_an_import_may_not_take_long(warm, set_yaml):
    source = "x = sum(i * i for i in range(8_000_000))\n" + STILL
    tasks = set_yaml(cpu={"start": 0.15, "step": 0.02, "bank": 1.0})
    (episode,) = verify_episodes(source, tasks, 1, split="dev", judge=warm).episodes
    assert "of CPU time for import and reset; 0.15 s are allowed" in episode.error


def test_results_that_depend_on_the_clock_are_marked(warm, set_yaml):
    """Those of controllers that read it, or that use over half of their CPU budget."""
    tasks = set_yaml()
    source = "from time import monotonic\n" + STILL
    report = verify_episodes(source, tasks, 2, split="dev", judge=warm)
    assert report.clock_dependent == "it reads the clock"
    slow, quick = report.episodes
    budget = tasks.file.cpu
    most = budget.start + budget.of_steps(slow.steps)
    slow = slow.model_copy(update={"cpu_seconds": 0.51 * most})
    quick = quick.model_copy(update={"cpu_seconds": 0.49 * most})
    assert clock_dependence(STILL.encode(), [quick], budget) is None
    assert clock_dependence(STILL.encode(), [slow, quick], budget) == (
        "in 1 of 2 episodes it used over half of its CPU budget"
    )


@pytest.mark.slow
def test_equal_beside_busy_loops(tmp_path):
    """A controller that reads no clock gets the same results, but for the times."""
    busy = [sys.executable, "-c", "while True: pass"]
    reports = []
    for loops in (0, 2 * (os.cpu_count() or 1)):
        beside = [subprocess.Popen(busy) for _ in range(loops)]
        try:
            report = verify_episodes(KNOWN, load_set("known"), 4, split="dev")
        finally:
            for process in beside:
                process.kill()
                process.wait()
        assert report.clock_dependent is None
        told = report.model_dump(exclude={"seconds", "child_cpu_seconds"})
        for episode in told["episodes"]:
            del episode["cpu_seconds"]
        reports.append(told)
    assert reports[0] == reports[1]


def test_a_sequential_test_stops_early(warm, set_yaml):
    report = verify_episodes(STILL, set_yaml(bar=0.9), split="test", judge=warm)
    assert report.sequential.decision == "rejected"
    assert not report.passed
    assert report.count < 10
    assert report.scores is None
    assert report.interval is None
    assert report.by_generator == {}


def test_equal_runs_are_equal(warm, set_yaml, tmp_path):
    """All but the times; also the noise of each world."""
    source = "def policy(obs):\n    return 1.0, 0.8 + 0.01 * float(obs['ranges'][0])\n"
    runs = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        lost = load_set("lost").file.model_dump(include={"disturbances", "observed"})
        tasks = set_yaml(**lost)
        verify_episodes(source, tasks, 3, split="dev", judge=warm, out=folder)
        files = sorted((folder / "trajectories").iterdir())
        runs.append([Trajectory.load(path) for path in files])
    for one, other in zip(*runs, strict=True):
        assert np.array_equal(one.poses, other.poses)
        assert np.array_equal(one.ranges, other.ranges)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("train", 3), "split"),
        (("hidden", 3), "split 'hidden' needs a salt"),
        (("dev", 0), "episodes"),
    ],
)
def test_arguments_that_are_refused(set_yaml, arguments, message):
    with pytest.raises(TaskError, match=message):
        verify_episodes(STILL, set_yaml(), arguments[1], split=arguments[0])


@pytest.mark.slow
def test_the_command(tdac, rejected, done, tmp_path):
    """Exit 0 with scores or an accepting test, 1 with a rejecting one."""
    words = ("verify", str(KNOWN), "--set", "known", "--split", "dev", "-n", "2")
    code, out, err = tdac(*words)
    assert (code, err) == (0, "")
    assert "worlds 0 to 1 of dev: 2 reached, 0 failed" in out
    assert "BARN score" in out
    out = done(*words, "--json")
    assert json.loads(out)["successes"] == 2
    still = tmp_path / "still.py"
    still.write_text(STILL)
    out = rejected("verify", str(still), "--set", "unknown")
    assert "not verified: rejected at 95.0 %" in out


@pytest.mark.slow
def test_our_own_controller_by_its_name(done):
    """As in bench, evaluate and play; a file of this name needs its suffix."""
    words = ("--set", "known", "--split", "dev", "-n", "1", "--json")
    out = done("verify", "builtin", *words)
    assert json.loads(out)["provenance"]["controller_sha256"] == sha256_of(
        KNOWN.read_bytes()
    )


def test_few_hidden_worlds_of_a_generator_have_no_row(
    warm, set_yaml, tmp_path, monkeypatch
):
    """It would tell a single world."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    salt = tmp_path / "my.salt"
    salt.write_bytes(b"a salt of some bytes, for rows")
    report = verify_episodes(
        STILL, set_yaml(), 5, split="hidden", salt_file=salt, judge=warm
    )
    assert (report.count, report.by_generator) == (5, {})


def test_the_command_tells_a_refused_file(tdac, tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("def policy(obs):\n    return 0.6\n")
    code, out, err = tdac("verify", str(wrong), "--set", "unknown", "-n", "3")
    assert (code, err) == (1, "")
    first, line, last = out.splitlines()
    assert first.endswith(": 1 of 11 tests failed, so no world was driven")
    assert line.startswith("  test_short_rollout_is_stable[10]: policy must return two")
    assert last == "not verified"


@pytest.mark.slow
def test_one_flag_for_episodes_and_worlds(done, refused, level, tmp_path):
    """The words for a task and for a set are the same; a set is not disturbed more."""
    (tmp_path / "still.py").write_text(STILL)
    words = ("verify", tmp_path / "still.py", "--set", level, "--first", "4")
    report = json.loads(done(*words, "-n", "2", "--json"))
    assert [each["index"] for each in report["episodes"]] == [4, 5]
    assert "worlds 4 to 5 of test" in done(*words, "--robust", "2")
    assert "leave out --delay" in refused(*words, "-n", "2", "--delay", "1")


def test_the_command_counts_hidden_evaluations(tdac, done, tmp_path, set_yaml):
    """The count is the last line; the second time says when it was driven."""
    set_yaml()
    salt, still = tmp_path / "a.salt", tmp_path / "still.py"
    salt.write_bytes(b"a salt of the command line")
    still.write_text(STILL + "# from the command line\n")
    words = ("verify", str(still), "--set", str(tmp_path / "few.yaml"))
    words += ("--split", "hidden", "--salt-file", str(salt), "-n", "2")
    code, out, _ = tdac(*words)
    last = "hidden evaluation 1 of this file on few"
    assert (code, out.splitlines()[-1]) == (0, last)
    again = done(*words)
    assert again.startswith(out.rstrip())
    assert again.rstrip().endswith("nothing was driven anew")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--split", "dev"), "--split needs --set NAME"),
        (("--hidden-folder", "x"), "--hidden-folder needs --set NAME"),
        (
            ("--set", "known", "--hidden-folder", "x"),
            "--hidden-folder needs --split hidden",
        ),
        (
            ("--set", "known", "--split", "hidden", "--hidden-folder", "x"),
            "set 'known' generates its worlds",
        ),
        (("--set", "unkown"), r"unknown task set 'unkown'"),
        (("--set", "known", "--task", "maze"), "leave out --task"),
        (("--set", "known", "--paper"), "leave out --paper"),
        (("--set", "known", "--first", "3"), "--first needs -n N"),
        (("--set", "known", "-n99", "--accept-at", "0.9"), "leave out --accept-at"),
        (("--set", "known", "-n", "0"), "-n"),
        (("--set", "known", "--split", "hidden"), "needs a salt"),
        (("--set", "known", "--salt-file", "no"), "split 'test' has a public salt|no"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    err = refused("verify", str(KNOWN), *words)
    assert any(part in err for part in message.split("|"))


@pytest.mark.slow
def test_a_set_without_a_feasible_world(tmp_path):
    """One line, after the tries that the set allows; no verdict."""
    (tmp_path / "own.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    path = tmp_path / "mine.yaml"
    level = {"worlds": [{"name": "aisles"}], "admission": {"gap": 10, "tries": 3}}
    path.write_text(yaml.safe_dump(level))
    with pytest.raises(TaskError, match="set 'mine', world 0: no feasible world from"):
        verify_episodes(tmp_path / "own.py", load_set(path), 2, split="dev")
