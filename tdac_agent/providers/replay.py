"""`replay:RUN`: the answers of a recorded run; no model is asked, nothing is paid."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from tdac_agent.errors import ProviderError, RunError
from tdac_agent.provider import PermanentFault, Reply, Request
from tdac_agent.providers.choice import Options
from tdac_agent.records import load_run

Place = tuple[str, int, int]


def make(words: str, options: Options) -> Replay:
    """A recorded run.

    Raises:
        ProviderError: There is none.
    """
    del options
    if not words:
        raise ProviderError("which run? As in replay:runs/maze-1")
    folder = Path(words)
    try:
        load_run(folder)
        lines = (folder / "journal.jsonl").read_bytes().splitlines()
    except RunError as error:
        raise ProviderError(f"cannot replay: {error}") from error
    except OSError as error:
        raise ProviderError(f"cannot replay {folder}: {error.strerror}") from error
    return Replay(folder, [line for line in map(_record, lines) if line])


class Replay:
    """A provider; see `Provider`. A question that was not put in that run is a fault.

    Args:
        folder: Of the run.
        journal: Its records.
    """

    paid = False

    def __init__(self, folder: Path, journal: list[dict[str, Any]]) -> None:
        self.name = f"replay:{folder}"
        self._folder = folder
        self._replies = [r for r in journal if r.get("event") == "call.reply"]
        self._asked: Counter[Place] = Counter()

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        _, k, j = request.sample
        place = (request.kind, k, j)
        number = self._asked[place]
        at = f"{request.kind} k={k} j={j}"
        try:
            prompt, reply = _files(self._folder, place, number + 1)
            _compare(prompt.read_text("utf-8"), request.prompt, f"{at} in {prompt}")
            text = reply.read_bytes().decode("utf-8", "surrogatepass")
            record = [r for r in self._replies if _place(r) == place][number]
        except (OSError, IndexError):
            raise PermanentFault(
                f"answer {number + 1} to {at} is not in {self._folder}"
            ) from None
        except ValueError:
            raise PermanentFault(f"{at} in {self._folder} is no text") from None
        self._asked[place] += 1
        return _reply(text, record)


def _files(folder: Path, place: Place, number: int) -> tuple[Path, Path]:
    """Question and answer of the numbered call of its kind for a candidate."""
    kind, k, j = place
    calls = folder / "iterations" / f"k{k:02d}" / f"j{j}"
    suffix = "" if number == 1 else f"-{number}"
    return calls / f"{kind}.prompt{suffix}.md", calls / f"{kind}.reply{suffix}.md"


def _compare(recorded: str, asked: str, where: str) -> None:
    """Refuses an answer to another question.

    Raises:
        PermanentFault: It names the first line that differs.
    """
    if recorded == asked:
        return
    pairs = zip(recorded.split("\n"), asked.split("\n"), strict=False)
    same = 0
    for old, new in pairs:
        if old != new:
            break
        same += 1
    raise PermanentFault(f"another question than {where}: line {same + 1} differs")


def _reply(text: str, record: dict[str, Any]) -> Reply:
    stop, model = record.get("stop"), record.get("model")
    notes = record.get("notes")
    if stop not in {"end", "length", "refusal"}:
        raise PermanentFault(f"the journal tells no stop reason, but {stop!r}")
    return Reply(
        text,
        stop,
        model=model if isinstance(model, str) else None,
        notes=tuple(map(str, notes)) if isinstance(notes, list) else (),
    )


def _place(record: dict[str, Any]) -> tuple[Any, Any, Any]:
    return record.get("kind"), record.get("k"), record.get("j")


def _record(line: bytes) -> dict[str, Any]:
    """A record of the journal; none where a line is torn."""
    try:
        record = json.loads(line.decode("utf-8"))
    except (ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}
