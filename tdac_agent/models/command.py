"""`command:PROGRAM ARGS`: a program that reads a prompt and prints the answer."""

from __future__ import annotations

import atexit
import errno
import os
import shlex
import shutil
import signal
import subprocess
import threading
from contextlib import suppress

from tdac_agent.errors import ProviderError
from tdac_agent.interpreter import given_environment
from tdac_agent.models.bounds import check_length
from tdac_agent.models.choice import Options
from tdac_agent.models.decoding import decode_answer
from tdac_agent.models.exchange import exchange
from tdac_agent.models.provider import (
    PermanentFault,
    ProviderFault,
    Reply,
    Request,
)
from tdac_agent.storage.secrets import one_line, without_secrets

AFTER_KILL_SECONDS = 5.0
_running: set[subprocess.Popen[bytes]] = set()
_registry = threading.Lock()


def make(words: str, options: Options) -> Command:
    """Returns a provider that runs a program.

    Raises:
        ProviderError: There is no such program, or the command cannot be parsed.
    """
    del options
    try:
        argv = shlex.split(words)
    except ValueError as error:
        raise ProviderError(f"cannot parse command:{words}: {error}") from error
    if not argv:
        raise ProviderError("command: needs a program, as in command:'llm -m my-model'")
    if shutil.which(argv[0]) is None:
        raise ProviderError(f"there is no program {argv[0]!r}, or it is not executable")
    return Command(argv)


class Command:
    """A provider that starts a program for each question; see `Provider`.

    Args:
        argv: Program and arguments.
    """

    paid = True
    concurrent = True

    def __init__(self, argv: list[str]) -> None:
        self.name = f"command:{without_secrets(shlex.join(argv))}"
        self._argv = argv

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        prompt = request.prompt.encode("utf-8", "replace")
        answer = self._run(prompt, request.seconds)
        return Reply(without_secrets(check_length(decode_answer(answer))))

    def _run(self, prompt: bytes, seconds: float) -> bytes:
        """Returns the program's output; afterwards its process group is killed."""
        pipe = subprocess.PIPE
        try:
            with _registry:
                process = subprocess.Popen(
                    self._argv,
                    stdin=pipe,
                    stdout=pipe,
                    stderr=pipe,
                    start_new_session=True,
                    env=given_environment(),
                )
                _running.add(process)
        except OSError as error:
            raise _unstarted(self._argv[0], error) from None
        try:
            out, err = exchange(process, prompt, seconds)
        except TimeoutError:
            raise ProviderFault(f"no answer in {seconds:.0f} s") from None
        finally:
            _end(process)
            with _registry:
                _running.discard(process)
        if process.returncode != 0:
            last_line = err.decode("utf-8", "replace").strip().rpartition("\n")[2]
            detail = f": {last_line}" if last_line else ""
            code = process.returncode
            ending = f"ended by signal {-code}" if code < 0 else f"exit code {code}"
            raise ProviderFault(one_line(f"{ending}{detail}"))
        return out


def _unstarted(program: str, error: OSError) -> ProviderFault:
    """The fault if a program cannot be started; a script's interpreter is named."""
    first = b""
    # raw read: a program to run
    with suppress(OSError), open(shutil.which(program) or program, "rb") as file:
        first = file.readline(200).rstrip()
    line = first.decode("utf-8", "replace")
    of = f" (its first line is {line!r})" if line.startswith("#!") else ""
    busy = error.errno in {errno.EAGAIN, errno.ENOMEM}
    fault = (ProviderFault if busy else PermanentFault)(
        one_line(without_secrets(f"cannot start {program!r}: {error.strerror}{of}"))
    )
    fault.billed = False
    return fault


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kills a program with its process group, and closes its pipes."""
    _kill(process)
    process.wait(AFTER_KILL_SECONDS)
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


@atexit.register
def _kill_all() -> None:
    """Kills all programs when this process ends, e.g. after an interrupt.

    The interrupt does not wait for the threads that asked them. The lock is kept: no
    thread starts another program, and none records a killed one as a fault.
    """
    _registry.acquire()
    for process in _running:
        _kill(process)
