"""Other disturbances on the worlds of a task set."""

import json
import subprocess
import sys

import pytest

from tdac_agent.problems.disturbed_set import disturbed_set
from tdac_agent.verification.judge.set_files import write_set
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

IDLE = "def policy(observation):\n    return 1.0, 1.0\n"


def tdac(*words):
    """Runs the program; returns its exit code and all that it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "tdac_agent", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("name", ["unknown", "epuck"])
def test_the_worlds_stay(name, tmp_path):
    """The same obstacles, start and goal; another hash, also after it was written."""
    own = load_set(name)
    other = disturbed_set(own, {"delay": 2, "wheel_slip": 0.1})
    assert other.sha256 != own.sha256
    assert other.file.disturbances.delay == 2
    read = load_set(write_set(other, tmp_path / "set.yaml"))
    assert read.sha256 == other.sha256
    for tasks in (other, read):
        world, mine = own.world("test", 3), tasks.world("test", 3)
        assert (world.start, world.goal) == (mine.start, mine.goal)


def test_without_sizes_it_is_the_set_itself():
    """Nothing typed, nothing changed."""
    own = load_set("unknown")
    assert disturbed_set(own, {}) is own


def test_lengths_are_those_that_the_robot_observes():
    """`floor` is in metres, with pixels of 5 cm."""
    own = load_set("floor")
    found = disturbed_set(own, {"pose_noise": 0.1}).file.disturbances.pose_noise
    assert found == pytest.approx(0.1 / own.file.resolution)


def test_hidden_worlds_are_those_of_the_set_as_it_is():
    """A set with other disturbances is no second try on them."""
    other = disturbed_set(load_set("unknown"), {"delay": 2})
    with pytest.raises(TaskError, match="has the public worlds of another set"):
        other.task("hidden", 0, b"0" * 16)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "unknown", "--delay", 2), "--delay needs -n N"),
        (
            ("--set", "unknown", "-n", 2, "--range-noise", 3),
            "disturbances.range_noise: expected at most 1, got 3",
        ),
        (
            ("--set", "epuck", "-n", 2, "--range-noise", 0.1),
            "an e-puck has no ranges and no localiser",
        ),
        (
            ("--set", "unknown", "-n", 2, "--split", "hidden", "--delay", 1),
            "--delay: hidden worlds are driven with the set's own disturbances",
        ),
    ],
)
def test_bad_input(tmp_path, words, said):
    """One line, and exit code 2."""
    file = tmp_path / "mine.py"
    file.write_text(IDLE)
    code, _, errors = tdac("verify", file, *words)
    assert code == 2
    assert said in errors
    assert len(errors.strip().splitlines()) == 1


@pytest.mark.slow
def test_verify_drives_with_them(tmp_path):
    """The report is about a set of its own, and says how to watch a failure."""
    file = tmp_path / "mine.py"
    file.write_text(IDLE)
    words = "--set", "unknown", "-n", 2, "--delay", 3
    code, printed, _ = tdac("verify", file, *words, "--out", tmp_path / "out")
    assert code == 0  # scores alone
    assert "unknown-disturbed" in printed
    assert "--set unknown --delay 3 --split test --index 0" in printed
    facts = json.loads((tmp_path / "out" / "episodes.json").read_text())["provenance"]
    other = disturbed_set(load_set("unknown"), {"delay": 3})
    assert facts["sha256"] == other.sha256
    video = tmp_path / "drive.gif"
    play = "--set", "unknown", "--index", 0, "--delay", 3, "--video", video
    assert tdac("play", file, *play)[0] == 1
    assert video.is_file()
