"""What `tdac doctor` tries: each thing in a process of its own, which may die of it."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_envs.core.errors import TdacError

# The first time, a slow machine compiles for minutes.
SECONDS = 900.0
KNOWN = 3
"""Exit code of a trial whose last words say all."""
REINSTALL = "a package is broken here: install tdac in a new environment"
ADVICE: dict[int, str] = {
    signal.SIGILL: "code for another processor; try NUMBA_CPU_NAME=generic, else "
    "install numba, numpy and opencv-python-headless anew",
    signal.SIGKILL: "ended from outside, as the system does when memory is short",
    signal.SIGSYS: "a filter of system calls, as of a container, forbids one of them",
    signal.SIGTERM: "ended from outside",
}


def attempt(name: str) -> tuple[bool, str]:
    """Tries something in a process of its own.

    Args:
        name: Of `TRIALS`.

    Returns:
        Whether it works, and how, or why not.
    """
    command = [sys.executable, "-P", "-m", __name__, name]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=SECONDS,
        )
    except subprocess.TimeoutExpired:
        return False, f"not done after {SECONDS:g} s"
    if done.returncode < 0:
        return False, died(-done.returncode)
    if done.returncode == 0:
        return True, _last_line(done.stdout)
    told = _last_line(done.stderr) or f"ended with exit code {done.returncode}"
    return False, told if done.returncode == KNOWN else f"{told}; {REINSTALL}"


def _last_line(said: bytes) -> str:
    lines = said.decode("utf-8", "replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "")


def died(number: int) -> str:
    """Says which signal ended a process, and what to do."""
    try:
        name = signal.Signals(number).name
    except ValueError:
        name = f"signal {number}"
    return f"died with {name}: {ADVICE.get(number, REINSTALL)}"


def compiled_step() -> str:
    """Takes one step of an environment."""
    import gymnasium as gym
    import numpy as np

    import tdac_envs  # noqa: F401 - registers it

    env = gym.make("TDAC-Map2D-v0")
    env.reset(seed=0)
    observation = env.step(np.ones(2, np.float32))[0]
    if observation not in env.observation_space:
        raise Fault(f"a step gave {observation}, which is no observation")
    return "TDAC-Map2D-v0 takes a step"


def verification() -> str:
    """Has a good controller judged, in the sandbox tier in use."""
    from tdac_agent.builtin.provider import template_of
    from tdac_agent.tasks.task import load_task
    from tdac_agent.verification.verify import verify

    task = load_task("maze")
    template = template_of(task.setting)
    source = template.render(template.kind())
    report = verify(source, task, paper=True)
    if not report.passed:
        failed = report.failures[0]
        told = f"{failed.test}: {failed.message}"
        raise Fault(
            f"no verdict is worth anything here: a good controller fails {told}"
        )
    passed, seconds = len(report.tests), report.seconds
    return f"a good controller passes {passed} tests in {seconds:.1f} s"


def video() -> str:
    """Encodes a frame."""
    import numpy as np
    from imageio_ffmpeg import get_ffmpeg_version

    from tdac_envs.drawing.video import write_video

    with tempfile.TemporaryDirectory(prefix="tdac-doctor-") as folder:
        frame = np.zeros((48, 64, 3), np.uint8)
        write_video([frame], Path(folder, "frame.mp4"), fps=20)
    return f"ffmpeg {get_ffmpeg_version()}"


TRIALS: dict[str, Callable[[], str]] = {
    trial.__name__: trial for trial in (compiled_step, verification, video)
}


if __name__ == "__main__":
    try:
        print(TRIALS[sys.argv[1]]())
    except (TdacError, Fault) as error:
        print(*str(error).split(), file=sys.stderr)
        sys.exit(KNOWN)
