"""`replay:RUN`: the answers of a recorded run; no model is asked, no cost arises.

Two runs are shipped: `replay:demo` is the one of `tdac demo`, and `replay:rules` is one
in which the optimizer derives rules from the failures.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

from tdac_agent.errors import ProviderError, RunError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_agent.prompting.rules import BEGIN
from tdac_agent.runs.journal_state import reply_of
from tdac_agent.runs.ownership import OURS, is_own_folder
from tdac_agent.runs.run_record import JOURNAL, call_file, candidate_at, load_run
from tdac_agent.storage.files import read_inside
from tdac_agent.storage.hashes import sha256_of_json
from tdac_agent.storage.journal import JournalRecord, read_records
from tdac_envs.core.intake import RECORD_BYTES

DEMO = Path(__file__).parent / "demo"
RULES = Path(__file__).parent / "demo_rules"
SHIPPED = {"demo": DEMO, "rules": RULES}
"""The shipped runs by their names."""
Place = tuple[str, int, int]


def make(words: str, options: Options) -> Replay:
    """The provider for a recorded run.

    Raises:
        ProviderError: There is no such run, or it cannot be read.
    """
    del options
    if not words:
        raise ProviderError("replay: needs a run folder, as in replay:runs/maze-1")
    folder = SHIPPED.get(words, Path(words))
    try:
        recorded = load_run(folder)
        records = read_records(folder / JOURNAL)
    except RunError as error:
        raise ProviderError(f"cannot replay: {error}") from error
    except OSError as error:
        raise ProviderError(f"cannot replay {folder}: {error.strerror}") from error
    shipped = words in SHIPPED
    seed = recorded.seed if shipped or is_own_folder(recorded) else None
    replay = Replay(words, folder, records, reworded=shipped, seed=seed)
    replay.fixed = recorded.on_set and recorded.learner == recorded.optimizer == OURS
    return replay


class Replay:
    """Answers from a recorded run; see `Provider`. Any other question is a fault.

    Args:
        words: The run as the user named it.
        folder: Folder of the run.
        journal: Its records.
        reworded: Whether a question may have additional text before the recorded one,
            and may differ from the repair rules onwards; differences are noted.
        seed: Seed of its jittered starts; None if it has none, or is not trusted.

    Attributes:
        fixed: Whether the recorded learner had one controller only.
    """

    paid = False
    fixed = False

    def __init__(
        self,
        words: str,
        folder: Path,
        journal: list[JournalRecord],
        *,
        reworded: bool = False,
        seed: int | None = None,
    ) -> None:
        self.name = f"replay:{words}"
        self._folder = folder
        self._reworded = reworded
        self.recorded_seed = seed
        self._replies = [r for r in journal if r.get("event") == "call.reply"]

    def answers_sha256(self) -> str:
        """Hash of all recorded answers."""
        return sha256_of_json(self._replies)

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        _, k, j = request.sample
        place = (request.kind, k, j)
        number = request.turn
        at = f"{request.kind} k={k} j={j}"
        try:
            prompt, answer = _files(place, number + 1)
            where = f"{at} in {prompt}"
            recorded = read_inside(self._folder, prompt, RECORD_BYTES).decode("utf-8")
            notes = self._compare(recorded, request, where)
            text = read_inside(self._folder, answer, RECORD_BYTES).decode(
                "utf-8", "surrogatepass"
            )
            record = [r for r in self._replies if _place(r) == place][number]
        except (OSError, IndexError):
            raise PermanentFault(
                f"answer {number + 1} to {at} is not in {self._folder}"
            ) from None
        except ValueError:
            raise PermanentFault(f"{at} in {self._folder} is not UTF-8") from None
        reply = reply_of(record, text)
        if reply is None:
            raise PermanentFault(f"the journal of {self._folder} is damaged at {at}")
        return replace(
            reply,
            tokens_in=0,
            tokens_out=0,
            tokens_cached=0,
            tokens_written=0,
            notes=(*reply.notes, *notes),
        )

    def _compare(self, recorded: str, request: Request, where: str) -> tuple[str, ...]:
        """Compares a question with the recorded one; notes a permitted difference.

        Raises:
            PermanentFault: The questions differ; the message names the first such line.
        """
        asked = request.prompt
        if recorded == asked:
            return ()
        pairs = zip(recorded.split("\n"), asked.split("\n"), strict=False)
        same = sum(
            1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs)
        )
        line = f"line {same + 1}"
        # The introduction may have become longer.
        question = recorded.partition(BEGIN)[0]
        if self._reworded and asked.partition(BEGIN)[0].endswith(question):
            place = f" from {line} on" if same else ""
            return (
                f"the question is worded differently{place} than when it was recorded; "
                "the recorded answer is used",
            )
        raise PermanentFault(f"the question differs from the record in {line}: {where}")


def _files(place: Place, number: int) -> tuple[Path, Path]:
    """Files of question and answer of the numbered call of its kind, in a run."""
    kind, *at = place
    prompt, answer = (call_file(kind, what, number) for what in ("prompt", "reply"))
    return candidate_at(*at) / prompt, candidate_at(*at) / answer


def _place(record: JournalRecord) -> tuple[Any, Any, Any]:
    return record.get("kind"), record.get("k"), record.get("j")
