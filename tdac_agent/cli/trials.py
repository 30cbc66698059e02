"""The trials of `tdac doctor`, each in its own process, since a trial may kill it."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.interpreter import python, safe_environment
from tdac_envs.core.errors import TdacError

# On first use, a slow machine compiles for minutes.
SECONDS = 900.0
KNOWN = 3
"""Exit code of a trial whose last line on stderr explains the failure."""
REINSTALL = "a package is broken: install tdac in a new environment"
ADVICE: dict[int, str] = {
    signal.SIGILL: "code for another processor; try NUMBA_CPU_NAME=generic, else "
    "reinstall numba, numpy and opencv-python-headless",
    signal.SIGKILL: "killed from outside, as the system does when memory is short",
    signal.SIGSYS: "a system call filter, for example of a container, forbids a call",
    signal.SIGTERM: "terminated from outside",
}


def attempt(name: str) -> tuple[bool, str]:
    """Runs a trial of `TRIALS` in its own process.

    Returns:
        Whether it works, and a line on what works or why it does not.
    """
    command = python("-m", __name__, name)
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=safe_environment(),
            check=False,
            timeout=SECONDS,
        )
    except subprocess.TimeoutExpired:
        return False, f"did not finish within {SECONDS:g} s"
    if done.returncode < 0:
        return False, describe_signal(-done.returncode)
    if done.returncode == 0:
        return True, _last_line(done.stdout)
    reason = _last_line(done.stderr) or f"ended with exit code {done.returncode}"
    return False, reason if done.returncode == KNOWN else f"{reason}; {REINSTALL}"


def _last_line(output: bytes) -> str:
    lines = output.decode("utf-8", "replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "")


def describe_signal(number: int) -> str:
    """Names the signal that ended a process, and what to do."""
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
        raise Fault(f"a step returned an invalid observation: {observation}")
    return "TDAC-Map2D-v0 takes a step"


def verification() -> str:
    """Verifies a good controller in the sandbox tier in use."""
    from tdac_agent.builtin.provider import template_of
    from tdac_agent.runs.ownership import load_task
    from tdac_agent.verification.verify import verify

    task = load_task("maze")
    template = template_of(task.setting)
    source = template.render(template.kind())
    report = verify(source, task, paper=True)
    if not report.passed:
        failed = report.failures[0]
        raise Fault(
            "verdicts are unreliable on this machine: a good controller fails "
            f"{failed.test}: {failed.message}"
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
