"""Each kind of file of a user's folder, with what a file can be instead of one."""

import os
import shutil
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from tdac_agent.runs.replay import DEMO

SECONDS = 60


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        file: Its name in the folder.
        words: The command that reads it, given in the folder.
        furnish: Writes what lies beside it.
        text: Whether it is a text.
        inside: Whether it is part of a folder that somebody else may have made.
    """

    file: str
    words: tuple[str, ...]
    furnish: Callable[[Path], object] = lambda folder: None
    text: bool = True
    inside: bool = False

    def __str__(self) -> str:
        return self.file


def demo(folder):
    shutil.copytree(DEMO, folder / "run")


REPLAY = ("synth", "--learner", "replay:run", "--dry-run")
SYNTH = ("synth", "--task", "maze", "--dry-run")
ASKED = "run/iterations/k01/j0/generate"
KINDS = (
    Kind("task.yaml", ("synth", "--task", "task.yaml", "--dry-run")),
    Kind("nice.yaml", ("campaign", "nice.yaml", "--out", "out")),
    Kind("set.yaml", ("verify", "builtin", "--set", "set.yaml")),
    Kind("plan.png", ("map", "plan.png", "--radius", "6"), text=False),
    Kind("plan.npy", ("map", "plan.npy"), text=False),
    Kind("w.wbt", ("world", "w.wbt")),
    Kind("given.py", ("verify", "given.py"), text=False),
    Kind("policy.zip", ("evaluate", "policy.zip"), text=False),
    Kind("mine.j2", (*SYNTH, "--prompt", "mine.j2")),
    Kind("rules.md", (*SYNTH, "--rules", "rules.md")),
    Kind("salt", ("verify", "builtin", "--set", "unknown", "--split", "hidden",
                  "--salt-file", "salt")),
    Kind("run/run.json", ("rules", "run"), demo, inside=True),
    Kind("run/rules.json", ("rules", "run"), demo, inside=True),
    Kind("run/journal.jsonl", REPLAY, demo, text=False, inside=True),
    Kind("b/bench.json", ("bench", "show", "b")),
)  # fmt: skip


def sparse(path):
    path.touch()
    os.truncate(path, 8 * 10**9)


def pipe(path):
    os.mkfifo(path)


def device(path):
    path.symlink_to("/dev/zero")


def folder(path):
    path.mkdir()


def no_text(path):
    path.write_bytes(b"\xff\xfe\x00x: \xff")


def link_out(path):
    path.symlink_to(path.absolute().parents[2] / "secret.txt")


ATTACKS = (sparse, pipe, device, folder, no_text, link_out)
CASES = [
    pytest.param(kind, attack, id=f"{kind}-{attack.__name__}")
    for kind in KINDS
    for attack in ATTACKS
    if (attack is not no_text or kind.text) and (attack is not link_out or kind.inside)
]


@pytest.fixture
def patience():
    """Ends a read that would wait for ever."""

    def late(number, frame):
        raise TimeoutError(f"more than {SECONDS} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(("kind", "attack"), CASES)
def test_what_is_no_such_file_is_refused(tdac, patience, tmp_path, kind, attack):
    """Exit 2 and one line: a pipe, a device, a huge file, no text, a link out."""
    here = Path.cwd()
    (tmp_path / "secret.txt").write_text("hunter2: [secret\n")
    kind.furnish(here)
    file = here / kind.file
    file.parent.mkdir(exist_ok=True, parents=True)
    file.unlink(missing_ok=True)
    attack(file)
    code, _, err = tdac(*kind.words)
    lines = [x for x in err.splitlines() if not x.startswith("tdac: compiling")]
    assert (code, len(lines)) == (2, 1), err
    assert "hunter2" not in err
