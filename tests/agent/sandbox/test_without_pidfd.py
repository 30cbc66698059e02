"""A kernel or container without process descriptors is as good as any other."""

import errno
import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import tdac_agent
from tdac_agent.sandbox.inner import syscalls

ROOT = Path(next(iter(tdac_agent.__path__))).parent
# Refuses `pidfd_open`, which has this number on all processors, and then verifies.
SCRIPT = """
    import json, os, sys
    from pathlib import Path

    from tdac_agent.sandbox.inner import seccomp

    seccomp.install([
        (0x20, 0, 0, 0),
        (0x15, 0, 1, 434),
        (0x06, 0, 0, 0x00050000 | int(sys.argv[1])),
        (0x06, 0, 0, 0x7FFF0000),
    ])
    try:
        os.pidfd_open(os.getpid())
    except OSError as error:
        assert error.errno == int(sys.argv[1])
    else:
        raise AssertionError("not refused")

    from tdac_agent import load_task
    from tdac_agent.verification.verify import verify
    from tdac_agent.verification.judge.warm import WarmJudge

    task, sources = load_task(sys.argv[2]), json.loads(sys.stdin.read())
    with WarmJudge() as judge:
        for source in sources:
            report = verify(source, task, profile="policy", paper=True, judge=judge)
            print(json.dumps([report.passed, report.episodes[0].error]))
"""


@pytest.mark.slow
@pytest.mark.skipif(
    os.uname().machine not in syscalls.MACHINES, reason="no table of system calls"
)
@pytest.mark.parametrize("refusal", [errno.ENOSYS, errno.EPERM])
def test_verdicts_are_as_ever(good, good_source, refusal):
    """A good controller passes, one that dies is told so, and the judge goes on."""
    dies = "import os\n\n\ndef policy(obs):\n    os._exit(3)\n"
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(SCRIPT), str(refusal), good],
        input=json.dumps([good_source, dies, good_source]),
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    told = [json.loads(line) for line in done.stdout.splitlines()]
    died = "ended its own process with exit code 3 at policy"
    assert told == [[True, None], [False, died], [True, None]]
