"""Judges one controller of the zoo among canaries, and says what it got and harmed."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import select
import socket
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

from cases import Case
from grounds import zoo_task

import tdac_agent
from tdac_agent.errors import Fault
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.installation import lasting_secret, secret_file
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import verify

PACKAGE = Path(tdac_agent.__file__).parent
LIMITS = Limits(import_seconds=4.0, reset_seconds=4.0, call_seconds=4.0, cpu_seconds=60)
KEY = "ANTHROPIC_API_KEY"
MOST_SECONDS = 120.0
GONE_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class Result:
    """What came of judging one controller."""

    tier: str
    passed: bool
    failed: tuple[str, ...]
    messages: str
    feedback: str
    harm: tuple[str, ...]
    seconds: float


class Enclosure:
    """A warm judge that holds no key though its parent does. A context manager.

    What the judge starts is watched: after a verification, nothing of it may be left.
    """

    def __enter__(self) -> Enclosure:
        self._key = f"key-{secrets.token_hex(8)}"
        with tempfile.TemporaryDirectory(prefix="zoo-judge-") as name:
            self._folder = Path(name).resolve()
        self._folder.mkdir()
        before, temporary = os.environ.get(KEY), tempfile.tempdir
        os.environ[KEY], tempfile.tempdir = self._key, str(self._folder)
        try:
            self._judge = WarmJudge()
        finally:
            tempfile.tempdir = temporary
            del os.environ[KEY]
            if before is not None:
                os.environ[KEY] = before
        return self

    def __exit__(self, *error: object) -> None:
        self._judge.close()
        self._folder.rmdir()

    def judge(self, case: Case, tier: str) -> Result:
        """Verifies a case on one tier, among canaries."""
        with (
            tempfile.TemporaryDirectory(prefix="zoo-") as name,
            Canaries(name) as around,
        ):
            source = around.fill_in(case.body)
            began = time.monotonic()
            try:
                report = verify(
                    source,
                    zoo_task(case.kind),
                    profile=case.header["profile"],  # type: ignore[arg-type]
                    tier=tier,
                    seed=None if case.header.get("seed") else 0,
                    limits=_limits(case),
                    judge=self._judge,
                )
            except Fault as fault:
                return Result(tier, False, (), f"fault: {fault}", "", ("judge",), 0.0)
            seconds = time.monotonic() - began
            signs = around.signs(report) | {
                "key read": self._key in report.model_dump_json(),
                "something left": bool(self._left()),
                "time": seconds > MOST_SECONDS,
            }
        return Result(
            tier,
            report.passed,
            tuple(failure.test.partition("::")[2] for failure in report.failures),
            "\n".join(failure.message for failure in report.failures),
            render_feedback(report),
            tuple(name for name, reached in signs.items() if reached),
            seconds,
        )

    def _left(self) -> list[str]:
        """Processes and folders that stay, but for those of children started ahead."""
        deadline = time.monotonic() + GONE_SECONDS
        while (left := self._leftovers()) and time.monotonic() < deadline:
            select.select([], [], [], 0.05)
        return left

    def _leftovers(self) -> list[str]:
        running = _processes()
        family = {os.getpid()}
        while (
            more := {p for p, (parent, _) in running.items() if parent in family}
            - family
        ):
            family |= more
        ours = os.fsencode(self._folder)
        places = {pid: place for pid, (_, place) in running.items() if ours in place}
        used = b"".join(place for pid, place in places.items() if pid in family)
        folders = [str(path) for path in self._folder.glob("*/tdac-child-*")]
        return [str(pid) for pid in places if pid not in family] + [
            folder for folder in folders if os.fsencode(folder) not in used
        ]


def _processes() -> dict[int, tuple[int, bytes]]:
    """Parent and environment of each process."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            environment = (folder / "environ").read_bytes()
            if fields[0] not in "ZX":
                found[int(folder.name)] = (int(fields[1]), environment)
    return found


def _limits(case: Case) -> Limits:
    """The usual ones for who shall pass; less patience with attacks."""
    words = [word.split("=") for word in case.header.get("limits", "").split()]
    changes = {name: type(getattr(LIMITS, name))(value) for name, value in words}
    return replace(Limits() if case.good else LIMITS, **changes)


def differences(case: Case, result: Result) -> list[str]:
    """How a result differs from what the case's header promises."""
    found = []
    if result.passed != case.passes:
        found.append(f"{'passed' if result.passed else 'failed'}: {result.messages}")
    wanted = case.header.get("fails", "").removeprefix("only ")
    names = {name.strip() for name in wanted.split(",") if name.strip()}
    missing = names - set(result.failed)
    if missing:
        found.append(f"did not fail: {', '.join(sorted(missing))}")
    if case.header.get("fails", "").startswith("only ") and set(result.failed) - names:
        found.append(f"failed, too: {', '.join(sorted(set(result.failed) - names))}")
    error = case.expected("error", result.tier)
    if error and not re.search(error, result.messages):
        found.append(f"no message matches {error!r}: {result.messages}")
    harm = list(filter(None, case.header.get(f"harm {result.tier}", "").split(", ")))
    if sorted(harm) != sorted(result.harm):
        found.append(f"harmed {list(result.harm)}, expected {harm}")
    hidden = case.header.get("hides")
    if hidden and re.search(hidden, result.feedback):
        found.append(f"feedback shows {hidden!r}: {result.feedback}")
    return found


class Canaries:
    """Things that no controller may reach; each tells when it was.

    A context manager: the sockets listen inside it.

    Args:
        folder: Where to keep them.
    """

    def __init__(self, folder: str) -> None:
        self._folder = Path(folder).resolve()
        self._target = self._folder / "target"
        self._target.mkdir()
        (self._target / "kept.txt").write_text("kept")
        self._token = f"file-{secrets.token_hex(8)}"
        (self._folder / "secret.txt").write_text(self._token)

    def __enter__(self) -> Canaries:
        self._sockets = {
            "tcp": socket.create_server(("127.0.0.1", 0)),
            "udp": socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
            "unix": socket.socket(socket.AF_UNIX),
        }
        self._sockets["udp"].bind(("127.0.0.1", 0))
        self._sockets["unix"].bind(str(self._folder / "socket"))
        self._sockets["unix"].listen()
        self._code = _code_hash()
        return self

    def __exit__(self, *error: object) -> None:
        for listener in self._sockets.values():
            listener.close()

    def fill_in(self, source: bytes) -> bytes:
        """Replaces the placeholders of a source."""
        places = {
            "SECRET": self._folder / "secret.txt",
            "TARGET": self._target,
            "PACKAGE": PACKAGE,
            "TCP": self._sockets["tcp"].getsockname()[1],
            "UDP": self._sockets["udp"].getsockname()[1],
            "UNIX": self._folder / "socket",
            "STATE": secret_file(),
        }
        for name, value in places.items():
            source = source.replace(f"@{name}@".encode(), str(value).encode())
        return source

    def signs(self, report: Report) -> dict[str, bool]:
        """What can be harmed, and whether it was."""
        text = report.model_dump_json()
        return {
            "file read": self._token in text,
            "secret read": (lasting_secret() or b"?").hex() in text,
            "terminal": "\\u001b" in text,
            **self.touched(),
        }

    @property
    def port(self) -> int:
        """Of the TCP socket that listens."""
        return int(self._sockets["tcp"].getsockname()[1])

    def touched(self) -> dict[str, bool]:
        """What can be written to or called, and whether it was."""
        written = {
            path.name: path.read_text() if path.is_file() else ""
            for path in self._target.glob("*")
        }
        return {
            "file written": written != {"kept.txt": "kept"},
            "code changed": _code_hash() != self._code,
            **{name: _was_called(sock) for name, sock in self._sockets.items()},
        }


def _was_called(listener: socket.socket) -> bool:
    return bool(select.select([listener], [], [], 0)[0])


def _code_hash() -> str:
    """Hash of the suite and of what runs in the child."""
    digest = hashlib.sha256()
    for folder in ("verification/suite", "sandbox/inner"):
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()
