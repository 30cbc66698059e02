"""Warm judges: processes that are started before their jobs.

Importing a judge takes about a second, and starting a sandboxed child a tenth of that.
A server process does the importing once; for each verification it forks a worker, which
starts its children and then waits for its job. A worker does one job and ends, so that
no state of a verification is left for the next one.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.interpreter import PATHS, SAFE, python, safe_environment
from tdac_agent.storage.locks import wait_for
from tdac_agent.storage.secrets import SECRET
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.worker_pool import end_with_parent

# Environment variables of Python that the judge's process keeps. Others can change a
# verdict; PYTHONOPTIMIZE, for example, removes every assertion.
KEPT_VARIABLES = frozenset(
    [SAFE, PATHS, "PYTHONHOME", "PYTHONUSERBASE", "PYTHONDONTWRITEBYTECODE"]
)
# A start on a busy machine may take minutes; a dead server is noticed at once.
START_SECONDS = 600.0
EXIT_SECONDS = 5.0
# See `tdac_agent.verification.judge.server`, which takes long to import.
_DIED = b"died"
POLL_SECONDS = 0.2


class WarmJudge:
    """Context manager that runs jobs, each in a worker process started in advance.

    The constructor returns at once; the judge warms up in the background.

    Args:
        child_pool: Pool that the caller has started and will end. The server is then
            forked from this process, which should have a single thread, and shares its
            imports. By default the server is a new interpreter.
        task: Task of most jobs, for which a new interpreter prepares; for others, it
            loads later what they need.
        turn: File that is locked during a job, so that judges that share it run one job
            at a time.
        watch: Called repeatedly during each job; an exception from it ends the job.

    Attributes:
        folder: Its temporary folder, which `close` removes.
    """

    def __init__(
        self,
        child_pool: ChildPool | None = None,
        *,
        task: Task | None = None,
        turn: Path | None = None,
        watch: Callable[[], None] | None = None,
    ) -> None:
        self._turn, self._watch = turn, watch
        environment = {
            name: value
            for name, value in safe_environment().items()
            if (not name.startswith(("PYTHON", "PYTEST")) or name in KEPT_VARIABLES)
            and not SECRET.search(name)
        }
        environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
        environment["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
        environment.setdefault("OPENBLAS_NUM_THREADS", "1")
        # A worker that is killed leaves the folders of its children here.
        self._folder = tempfile.TemporaryDirectory(
            prefix="tdac-judge-", ignore_cleanup_errors=True
        )
        self.folder = Path(self._folder.name)
        environment["TMPDIR"] = self._folder.name
        # The process and the name of a series that may go on.
        self._series: tuple[int, str] | None = None
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by close()
        place = environment, self.folder, self._log.fileno()
        if child_pool is None:
            known = [] if task is None else [lay_out(task, self.folder / "task")]
            self._server = _start_server(known, *place)
        else:
            self._server = _fork_server(child_pool, *place)

    def run(
        self,
        request: Path,
        seconds: float,
        meanwhile: Callable[[], None] | None = None,
        series: str = "",
    ) -> None:
        """Runs one job; returns when it is done, or when its worker has died.

        Args:
            request: File with the job.
            seconds: Limit of the wall time, s.
            meanwhile: Called repeatedly until the job is done.
            series: Name of its series. Jobs of a series that follow each other have
                one worker, so that the later ones begin at once.

        Raises:
            Fault: The judge did not start, or the job took too long.
        """
        with nullcontext() if self._turn is None else wait_for(self._turn):
            self._run(request, seconds, meanwhile, series)

    def _run(
        self,
        request: Path,
        seconds: float,
        meanwhile: Callable[[], None] | None,
        series: str,
    ) -> None:
        poll = partial(_call_all, (self._watch, meanwhile))
        worker = self._next_in(series)
        if worker is None:
            self.end_series()
            worker = self._worker(poll)
        self._series = None
        answer = self._request(f"{request}", worker, seconds, poll)
        if series and answer != _DIED:
            self._series = worker, series

    def _next_in(self, series: str) -> int | None:
        """The worker that waits for the next job of a series; None if there is none."""
        if self._series is None or self._series[1] != series or self._has_answer():
            return None
        return self._series[0]

    def end_series(self) -> None:
        """Ends the worker of a series, if there is one."""
        own, self._series = self._series, None
        # It may have died while it waited; then the next worker must not be ended.
        if own is not None and not self._has_answer():
            self._request("", own[0], EXIT_SECONDS)

    def _has_answer(self) -> bool:
        return bool(select.select([self._server.answers], [], [], 0.0)[0])

    def _request(
        self,
        line: str,
        worker: int,
        seconds: float,
        poll: Callable[[], None] | None = None,
    ) -> bytes:
        """Sends a line to a worker, and returns the answer."""
        try:
            os.write(self._server.requests, f"{line}\n".encode())
            return self._line(seconds, poll)
        except BaseException:
            # A worker leads a process group; its children end with it.
            with suppress(ProcessLookupError):  # it has just ended by itself
                os.killpg(worker, signal.SIGKILL)
            self._line(EXIT_SECONDS)
            raise

    def _worker(self, poll: Callable[[], None]) -> int:
        """Process id of the worker that waits for a job."""
        line = b""
        while not line.startswith(b"worker "):
            line = self._line(START_SECONDS, poll)
        return int(line.split()[1])

    def close(self) -> None:
        """Ends the server, its worker and their children."""
        self._server.end()
        self._log.close()
        self._folder.cleanup()

    def __enter__(self) -> WarmJudge:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _line(
        self, seconds: float, meanwhile: Callable[[], None] | None = None
    ) -> bytes:
        stream, deadline = self._server.answers, time.monotonic() + seconds
        line = b""
        while not line.endswith(b"\n"):
            left = max(deadline - time.monotonic(), 0.0)
            if not select.select([stream], [], [], min(left, POLL_SECONDS))[0]:
                if left == 0.0:
                    raise Fault(f"the judge did not answer within {seconds:g} s")
                if meanwhile is not None:
                    meanwhile()
                continue
            read = os.read(stream, 1)
            if not read:
                raise Fault(f"the judge ended: {self._last_output()}")
            line += read
        return line[:-1]

    def _last_output(self) -> str:
        self._log.seek(0)
        text = self._log.read().decode("utf-8", "replace")
        kept = [line.strip() for line in text.splitlines() if line.strip()][-4:]
        return " | ".join(kept) or "no output"


def _call_all(functions: Iterable[Callable[[], None] | None]) -> None:
    for function in functions:
        if function is not None:
            function()


@dataclass(frozen=True, slots=True)
class _Server:
    """A server process.

    Attributes:
        requests: File descriptor to write to.
        answers: File descriptor to read from.
        end: Kills and reaps the process, and closes both descriptors.
    """

    requests: int
    answers: int
    end: Callable[[], None]


def _start_server(
    known: list[Path], environment: dict[str, str], folder: Path, log: int
) -> _Server:
    """Starts a server in a new interpreter, which reads a known task in advance."""
    process = subprocess.Popen(
        python("-m", "tdac_agent.verification.judge.server", *map(str, known)),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log,
        env=environment,
        cwd=folder,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None

    def end() -> None:
        process.kill()
        process.communicate()

    return _Server(process.stdin.fileno(), process.stdout.fileno(), end)


def _fork_server(
    child_pool: ChildPool, environment: dict[str, str], folder: Path, log: int
) -> _Server:
    """Forks a server from this process, with everything that it has imported."""
    import cv2

    (theirs_in, requests), (answers, theirs_out) = os.pipe(), os.pipe()
    # OpenCV's threads would not survive the fork, and the child would wait for them.
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    pid = os.fork()
    if pid == 0:
        try:
            os.setsid()
            end_with_parent()
            for number, descriptor in enumerate((theirs_in, theirs_out, log)):
                os.dup2(descriptor, number)
            for descriptor in (theirs_in, theirs_out, requests, answers):
                os.close(descriptor)
            os.environ.clear()
            os.environ.update(environment)
            tempfile.tempdir = None
            os.chdir(folder)
            from tdac_agent.verification.judge.server import serve

            serve(child_pool)
        finally:
            os._exit(1)
    cv2.setNumThreads(threads)
    os.close(theirs_in)
    os.close(theirs_out)

    def end() -> None:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        os.close(requests)
        os.close(answers)

    return _Server(requests, answers, end)
