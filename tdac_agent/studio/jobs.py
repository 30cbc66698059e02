"""Commands that the studio starts, as processes of their own.

They outlive the studio. Each has a folder with its command (`job.json`) and its output
(`output.txt`), by which another studio in the same folder finds it again. A `job.json`
that this installation did not write is shown, and is never started or stopped.
"""

from __future__ import annotations

import errno
import functools
import hmac
import itertools
import os
import shlex
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Self

from pydantic import AwareDatetime, BaseModel, Field, ValidationError

from tdac_agent.interpreter import python, safe_environment
from tdac_agent.library.listing import next_folder
from tdac_agent.storage.files import open_regular, write_atomic
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.studio.folder import STATE, made_within
from tdac_agent.tasks.installation import keyed
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file

Word = Annotated[str, Field(max_length=4096)]
JOBS, ABOUT, OUTPUT, ENDING = f"{STATE}/jobs", "job.json", "output.txt", "exit"
TAIL = 4000
"""Characters of an output that are shown."""
TAIL_BYTES = 4 * TAIL
_STARTED: list[subprocess.Popen[bytes]] = []
# Writes the exit code when the command has ended, also after the studio has. An
# interrupt is for the command, which has work to save.
_WRAPPED = """
import pathlib, subprocess, sys
process, code = subprocess.Popen(sys.argv[2:]), None
while code is None:
    try:
        code = process.wait()
    except KeyboardInterrupt:
        pass
pathlib.Path(sys.argv[1]).write_text(str(code))
"""


class JobFile(StrictRecord):
    """What was started.

    Attributes:
        words: The words after `tdac`.
        started: When.
        pid: Process group.
        born: Start time of the process, which tells it from a later one with its pid.
        about: What it works on: a run folder, or a folder of results.
        mark: MAC of all of it.
    """

    words: tuple[Word, ...] = Field(min_length=1, max_length=1000)
    started: AwareDatetime
    pid: int = Field(gt=1, lt=2**31)
    born: str = Field(pattern=r"^[0-9]{0,20}$")
    about: Word
    mark: str = Field("", max_length=64)

    def marked(self, file: Path) -> Self:
        """The same with the mark of this installation.

        Args:
            file: Where it is kept: elsewhere the mark does not hold.
        """
        return self.model_copy(update={"mark": _mark(self, file)})

    def is_ours(self, file: Path) -> bool:
        """Whether this installation wrote it there, as it is."""
        return hmac.compare_digest(self.mark.encode(), _mark(self, file).encode())


def read_job(file: Path) -> JobFile:
    """Reads the file of a job.

    Raises:
        OSError: It is missing, not regular, or too large.
        ValueError: It is damaged.
    """
    return JobFile.model_validate(parse_json(read_file(file, TEXT_BYTES)))


def write_job(file: Path, job: JobFile) -> JobFile:
    """Marks and writes the file of a job; returns what was written."""
    marked = job.marked(file)
    write_atomic(file, marked.model_dump_json() + "\n")
    return marked


def _mark(job: BaseModel, file: Path) -> str:
    facts = job.model_dump_json(exclude={"mark"})
    about = f"job|{file.absolute()}|{facts}"
    return keyed(about.encode("utf-8", "surrogatepass")).hex()


@dataclass(frozen=True, slots=True)
class StudioJob:
    """A command that was started.

    Attributes:
        folder: Its folder.
        file: What was started.
        ours: Whether this installation started it, and its file is unchanged.
    """

    folder: Path
    file: JobFile
    ours: bool

    @property
    def command(self) -> str:
        """The command as a user would type it."""
        return shlex.join(["tdac", *self.file.words])

    @property
    def running(self) -> bool:
        """Whether it still runs; nobody knows it of one that is not ours."""
        for process in list(_STARTED):
            if process.poll() is not None:
                _STARTED.remove(process)
        born = self.file.born
        return self.ours and bool(born) and _born(self.file.pid) == born

    @property
    def code(self) -> int | None:
        """Its exit code; None while it runs, or if it was killed."""
        try:
            return int(read_file(self.folder / ENDING, 16))
        except (OSError, ValueError):
            return None

    @property
    def seconds(self) -> float:
        """Time since it was started, s."""
        return (datetime.now(UTC) - self.file.started).total_seconds()

    def output(self) -> str:
        """The end of what it has printed."""
        file = self.folder / OUTPUT
        try:
            if not file.is_file():
                return ""
            with open_regular(file) as stream:
                size = stream.seek(0, os.SEEK_END)
                stream.seek(max(0, size - TAIL_BYTES))
                data = stream.read(TAIL_BYTES)
        except OSError:
            return ""
        return data.decode("utf-8", "replace")[-TAIL:]

    def stop(self) -> None:
        """Interrupts it, as Ctrl-C does."""
        if self.running and _leads_group(self.file.pid):
            os.killpg(self.file.pid, signal.SIGINT)


def start(place: Path, words: Sequence[str], about: str) -> StudioJob:
    """Starts `tdac` with some words, unless the same command is at work already.

    Args:
        place: Folder of the studio, and of the process.
        words: The words after `tdac`.
        about: What it works on.

    Raises:
        OSError: The folder cannot be written, a link leads out of it, or the command
            is too long to be recorded.
    """
    now = datetime.now(UTC).replace(microsecond=0)
    try:  # before anything is started; the process is filled in below
        facts = JobFile(words=tuple(words), started=now, pid=2, born="", about=about)
    except ValidationError as error:
        raise OSError(errno.EINVAL, one_line_reason(error)) from error
    before = job_of(place, about)
    if before is not None and before.running and before.file.words == facts.words:
        return before
    folder = _new_folder(made_within(place, JOBS))
    command = python("-m", "tdac_agent", *words)
    environment = {**safe_environment(), "PYTHONUNBUFFERED": "1", "COLUMNS": "100"}
    with (folder / OUTPUT).open("wb") as output:
        process = subprocess.Popen(
            python("-c", _WRAPPED, str(folder / ENDING), *command),
            cwd=place,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env=environment,
        )
    _STARTED.append(process)
    own = {"pid": process.pid, "born": _born(process.pid)}
    marked = write_job(folder / ABOUT, facts.model_copy(update=own))
    return StudioJob(folder, marked, ours=True)


def jobs(place: Path) -> list[StudioJob]:
    """The jobs that were started in a folder: ours, then others, the newest first."""
    known = []
    for file in (place / JOBS).glob(f"*/{ABOUT}"):
        with suppress(OSError, ValueError):  # a damaged one
            known.append(_read(file))
    return sorted(
        known,
        key=lambda job: (job.ours, job.file.started, job.folder.name),
        reverse=True,
    )


@functools.lru_cache(maxsize=10_000)
def _read(file: Path) -> StudioJob:
    """A job from its file, which never changes."""
    facts = read_job(file)
    return StudioJob(file.parent, facts, ours=facts.is_ours(file))


def job_of(place: Path, about: str) -> StudioJob | None:
    """The newest job that works on something: one of ours, if there is one."""
    return next((job for job in jobs(place) if job.file.about == about), None)


def stop_job(place: Path, about: str) -> None:
    """Interrupts the newest job that works on something, if it runs."""
    job = job_of(place, about)
    if job is not None:
        job.stop()


def free_folder(name: str, place: Path) -> str:
    """The next `runs/NAME-N` that neither exists nor was given to a command."""
    taken = {job.file.about for job in jobs(place)}
    return str(next_folder(name, place, taken))


def _new_folder(parent: Path) -> Path:
    for number in itertools.count(1):
        with suppress(FileExistsError):
            folder = parent / f"{number:05}"
            folder.mkdir(0o700)
            return folder
    raise AssertionError("unreachable")


def _leads_group(pid: int) -> bool:
    """Whether a process leads a group of its own, as each job does."""
    try:
        return pid > 1 and os.getpgid(pid) == pid != os.getpgrp()
    except OSError:
        return False


def _born(pid: int) -> str:
    """Start time of a process in clock ticks since boot; empty if it is gone."""
    try:
        # raw read: of the kernel
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if fields[0] == "Z" else fields[19]
