"""`make clients` tells what was trained, what failed and what could not run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOOL = ROOT / "tools/clients"
EXAMPLES = ROOT / "examples"


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
    )


@pytest.fixture
def tool(monkeypatch):
    """The modules of the tool."""
    monkeypatch.syspath_prepend(TOOL)
    import attempt
    import libraries

    yield attempt, libraries
    for name in ("attempt", "libraries"):
        del sys.modules[name]


def test_cleanrl_without_a_path_is_not_run():
    """The table has a row with the reason, and nothing has failed."""
    done = run(TOOL, "cleanrl", CLEANRL="")
    assert done.returncode == 0, done.stderr
    assert "| cleanrl |  | PPO" in done.stdout
    assert "not run: CLEANRL=PATH is not set |" in done.stdout


def test_an_unknown_library_is_named():
    """With those that there are."""
    done = run(TOOL, "sb4")
    assert done.returncode == 1
    assert "unknown library 'sb4'; expected some of sb3, sb3-contrib" in done.stderr


def test_every_program_is_there(tool):
    """Each library names a file, and what the table says about it."""
    _, libraries = tool
    for library in libraries.LIBRARIES.values():
        assert Path(library.program[0]).is_file()
        assert library.trained


@pytest.mark.parametrize(
    ("program", "timeout", "result", "said"),
    [
        ("print('first'); print('7 steps')", 60.0, "passed", "7 steps"),
        ("raise ValueError('too short')", 60.0, "failed", "ValueError: too short"),
        ("while True: pass", 0.5, "failed", "did not end within 0.5 s"),
    ],
)
def test_an_outcome_says_what_happened(tool, tmp_path, program, timeout, result, said):
    """The last line of a training, or why it failed."""
    attempt, libraries = tool
    binaries = tmp_path / "toy" / "bin"
    binaries.mkdir(parents=True)
    # An environment that exists, whose pip has nothing to do.
    python = binaries / "python"
    python.write_text(
        f'#!/bin/sh\n[ "$2" = pip ] && exit 0\nexec {sys.executable} "$@"\n'
    )
    python.chmod(0o755)
    file = tmp_path / "train.py"
    file.write_text(program)
    library = libraries.Library("PPO", (str(file),), (), (), torch=False)
    found = attempt.attempt("toy", library, tmp_path, timeout)
    assert (found.result, found.said) == (result, said)
    assert found.versions.startswith("gymnasium 1.")


@pytest.mark.slow
def test_the_example_trains_with_a_file_like_cleanrls(tmp_path):
    """It makes the maze by its id, with wrapper and batch as of Gymnasium 0.29."""
    file = tmp_path / "ppo.py"
    file.write_text(
        "import sys\n"
        "import gymnasium as gym\n"
        "import numpy as np\n"
        "id = sys.argv[sys.argv.index('--env-id') + 1]\n"
        "env = gym.wrappers.FlattenObservation(gym.make(id))\n"
        "env = gym.wrappers.ClipAction(env)\n"
        "env = gym.wrappers.TransformObservation(env, lambda o: np.clip(o, -10, 10))\n"
        "env.reset(seed=int(sys.argv[-1]))\n"
        "for _ in range(300):\n"
        "    result = env.step(np.full(2, 9.0, np.float32))\n"
        "    if result[2] or result[3]:\n"
        "        env.reset()\n"
        "envs = gym.vector.SyncVectorEnv([lambda: gym.make(id)])\n"
        "envs.reset(seed=1)\n"
        "ended = False\n"
        "while not ended:\n"
        "    _, _, ended, _, infos = envs.step(np.zeros((1, 2), np.float32))\n"
        "assert 'final_info' not in infos\n"
        "reward = envs.step(np.zeros((1, 2), np.float32))[1]\n"
        "assert reward != 0, 'the step after the end only resets'\n"
    )
    done = run("-W", "ignore", EXAMPLES / "cleanrl_maze.py", file, "--seed", "3")
    assert done.returncode == 0, done.stderr
    steps = int(done.stdout.splitlines()[-1].partition(" steps, ")[0])
    assert steps > 300
    assert done.stdout.endswith(": not learnt\n")
