"""`job.json`: what was started, marked by the installation that started it."""

from __future__ import annotations

import hmac
from pathlib import Path
from typing import Annotated, Self

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.installation import keyed
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file

Word = Annotated[str, Field(max_length=4096)]


class JobFile(PrintableRecord):
    """What was started.

    Attributes:
        words: The words after `tdac`.
        started: When.
        pid: Process group.
        born: Start time of the process, which tells it from a later one with its pid.
        about: What it works on: a run folder, or a folder of results.
        mark: MAC of all of it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

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
