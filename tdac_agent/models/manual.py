"""`manual:DIR`: a person or a script answers through files in a folder."""

from __future__ import annotations

import itertools
import sys
import time
from datetime import datetime
from pathlib import Path

from tdac_agent.errors import ProviderError
from tdac_agent.models.bounds import check_length
from tdac_agent.models.choice import Options
from tdac_agent.models.decoding import decode_answer
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.intake import RECORD_BYTES, read_file

POLL_SECONDS = 0.5


def make(words: str, options: Options) -> Manual:
    """Returns a provider that exchanges files in a folder.

    Raises:
        ProviderError: No folder is named, or it cannot be made.
    """
    del options
    if not words:
        raise ProviderError("manual: needs a folder, as in manual:questions")
    folder = Path(words)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProviderError(f"cannot make {folder}: {error.strerror}") from error
    return Manual(folder)


class Manual:
    """A provider that waits for `NNN.reply.md` without a time limit; see `Provider`.

    A question that is already in the folder keeps its number, so that a restarted run
    finds the earlier answers. `Request.repeat` tells identical questions apart.

    Args:
        folder: Folder of the questions and answers.
        poll: Seconds between two checks for an answer.
    """

    paid = True

    def __init__(self, folder: Path, poll: float = POLL_SECONDS) -> None:
        self.name = f"manual:{folder}"
        self._folder = folder
        self._poll = poll

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        try:
            existing = set(self._folder.glob("*.reply.md"))
            number = self._number(request)
            reply = self._folder / f"{number:03}.reply.md"
            self._announce(number, reply, exists=reply in existing)
            return Reply(self._wait(reply))
        except OSError as error:
            raise PermanentFault(f"{error.filename}: {error.strerror}") from None

    def _number(self, request: Request) -> int:
        """Returns the number of a question; writes the question if it is new."""
        repeat = request.repeat
        question = request.prompt.encode("utf-8", "surrogatepass")
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

    def _announce(self, number: int, reply: Path, *, exists: bool) -> None:
        """Prints which answer is awaited, or which existing one is used."""
        question = self._folder / f"{number:03}.prompt.md"
        line = f"waiting: write the answer to {question} into {reply}"
        if exists:
            written = datetime.fromtimestamp(reply.stat().st_mtime)
            line = f"using {reply}, which already existed, written {written:%F %H:%M}"
        print(line, file=sys.stderr)

    def _wait(self, path: Path) -> str:
        """Returns the text of an answer once it exists and no longer grows."""
        before = None
        while True:
            now = read_file(path, RECORD_BYTES) if path.exists() else b""
            if now.strip() and now == before:
                return check_length(decode_answer(now))
            before = now
            time.sleep(self._poll)
