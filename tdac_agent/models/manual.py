"""`manual:DIR`: a person, or anything else that reads and writes files."""

from __future__ import annotations

import itertools
import sys
import time
from datetime import datetime
from pathlib import Path

from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.intake import RECORD_BYTES, read_file

POLL_SECONDS = 0.5


def make(words: str, options: Options) -> Manual:
    """A folder in which somebody answers.

    Raises:
        ProviderError: It is not named, or cannot be made.
    """
    del options
    if not words:
        raise ProviderError("which folder? As in manual:questions")
    folder = Path(words)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProviderError(f"cannot make {folder}: {error.strerror}") from error
    return Manual(folder)


class Manual:
    """A provider; see `Provider`. It waits for `NNN.reply.md` without end.

    A question that is already in the folder keeps its number: a run that is started
    again finds what was answered before. Of equal questions the run says which it is.

    Args:
        folder: Where questions are put.
        poll: Seconds between two looks for an answer.
    """

    paid = True

    def __init__(self, folder: Path, poll: float = POLL_SECONDS) -> None:
        self.name = f"manual:{folder}"
        self._folder = folder
        self._poll = poll

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        try:
            there = set(self._folder.glob("*.reply.md"))
            number = self._number(request.prompt, request.repeat)
            reply = self._folder / f"{number:03}.reply.md"
            self._tell(number, reply, is_there=reply in there)
            return Reply(self._wait(reply))
        except OSError as error:
            raise PermanentFault(f"{error.filename}: {error.strerror}") from None

    def _number(self, prompt: str, repeat: int) -> int:
        """The number of a question; it is written down where it is a new one."""
        question = prompt.encode("utf-8", "surrogatepass")
        for number in itertools.count(1):
            path = self._folder / f"{number:03}.prompt.md"
            if not path.exists():
                write_atomic(path, question)
                return number
            if read_file(path, RECORD_BYTES) == question:
                if repeat == 0:
                    return number
                repeat -= 1
        raise AssertionError("unreachable")

    def _tell(self, number: int, reply: Path, *, is_there: bool) -> None:
        """Says what is waited for, or which older answer is taken."""
        question = self._folder / f"{number:03}.prompt.md"
        told = f"waiting: answer {question} in {reply}"
        if is_there:
            written = datetime.fromtimestamp(reply.stat().st_mtime)
            told = f"taking {reply}, which was there before, of {written:%F %H:%M}"
        print(told, file=sys.stderr)

    def _wait(self, path: Path) -> str:
        """The text of an answer, once it is there and no longer grows."""
        before = None
        while True:
            now = read_file(path, RECORD_BYTES) if path.exists() else b""
            if now.strip() and now == before:
                return now.decode("utf-8", "replace")
            before = now
            time.sleep(self._poll)
