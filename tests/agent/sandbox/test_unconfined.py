"""Where nothing confines a controller, it runs only for somebody who asks for that."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import tdac_agent
from tdac_agent.sandbox.inner import syscalls

ROOT = Path(next(iter(tdac_agent.__path__))).parent
# A container without namespaces and Landlock, then the command. Of x86_64 and aarch64:
# the numbers of `unshare`, `clone` and `clone3`; that of Landlock is the same.
SCRIPT = """
    import ctypes, os, struct, sys

    from tdac_agent.__main__ import main
    from tdac_agent.sandbox.inner import kernel

    UNSHARE, CLONE = {"x86_64": (272, 56), "aarch64": (97, 220)}[os.uname().machine]
    CLONE3, LANDLOCK, NEW_USER = 435, 444, 0x10000000
    ALLOW, REFUSE, NOT_THERE = 0x7FFF0000, 0x00050001, 0x00050026
    steps = [
        (0x20, 0, 0, 0),
        (0x15, 0, 1, UNSHARE), (0x06, 0, 0, REFUSE),
        (0x15, 0, 1, CLONE3), (0x06, 0, 0, NOT_THERE),
        (0x15, 0, 1, LANDLOCK), (0x06, 0, 0, NOT_THERE),
        (0x15, 0, 3, CLONE), (0x20, 0, 0, 16),
        (0x45, 0, 1, NEW_USER), (0x06, 0, 0, REFUSE),
        (0x06, 0, 0, ALLOW),
    ]
    code = b"".join(struct.pack("<HBBI", *step) for step in steps)
    held = ctypes.create_string_buffer(code, len(code))
    filter = struct.pack("@HP", len(steps), ctypes.addressof(held))
    kernel.prctl(kernel.PR_SET_NO_NEW_PRIVS, 1)
    kernel.syscall("seccomp", 1, 0, ctypes.create_string_buffer(filter, len(filter)))
    main()
"""


@pytest.fixture
def tdac_without_walls(tmp_path):
    """Runs a command where no tier works but the one that promises nothing."""
    if os.uname().machine not in syscalls.MACHINES:
        pytest.skip("no table of system calls")

    def run(*words):
        return subprocess.run(
            [sys.executable, "-c", textwrap.dedent(SCRIPT), *map(str, words)],
            env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
            capture_output=True,
            cwd=tmp_path,
            text=True,
            check=False,
        )

    return run


@pytest.mark.slow
@pytest.mark.parametrize("command", ["verify", "synth"])
def test_the_judge_refuses_in_one_line(tdac_without_walls, good, tmp_path, command):
    """Exit 3, the reason and what to do; the controller was not started."""
    trace = tmp_path / "trace"
    spy = f"open({str(trace)!r}, 'w')\n\n\ndef policy(obs):\n    return 0.0, 0.0\n"
    (good / "controller.py").write_text(spy)
    words = [good / "controller.py"] if command == "verify" else []
    task = good / "task.yaml"
    done = tdac_without_walls(command, *words, "--task", task)
    assert done.returncode == 3
    said = done.stderr.strip().splitlines()[-1]
    assert "no sandbox" in said
    assert "--tier rlimits" in said
    assert "Traceback" not in done.stderr
    assert not trace.exists()


@pytest.mark.slow
def test_who_asks_for_it_gets_it(tdac_without_walls, good):
    """A verdict, with a warning that says what it is not worth."""
    words = [good / "controller.py", "--task", good / "task.yaml", "--tier", "rlimits"]
    done = tdac_without_walls("verify", *words)
    assert done.returncode == 0, done.stderr
    assert "rlimits" in done.stdout + done.stderr
