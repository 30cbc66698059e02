"""The mark of a run: a MAC over its record and the files that a resumed run believes.

It covers the whole record, the template, the tests, the delivered controller, and the
journal as it was when the record was written. Later lines of the journal, and reports
that a resumed run reuses, have marks of their own in `run.marks`; that of a line is
written before the line.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tdac_agent.runs.run_record import JOURNAL, PROMPT_FILE, Run
from tdac_agent.storage.files import append_line, check_inside, read_inside
from tdac_agent.storage.hashes import sha256_of, sha256_of_file
from tdac_agent.storage.journal import (
    JOURNAL_BYTES,
    JournalRecord,
    line_of,
    whole_lines,
)
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.trust import tree_sha256

VERSION = "2"
MARKS = "run.marks"
_MARK = re.compile(rf"{VERSION}:([0-9]{{1,12}}):([0-9a-f]{{64}}(?:,[0-9a-f]{{64}})?)")


@dataclass(frozen=True, slots=True)
class Files:
    """Hashes of the files that a mark covers; empty for a missing file.

    Attributes:
        template: Of the template of the first question.
        suite: Of the user's own tests.
        controllers: Of the controller; two while one replaces the other.
    """

    template: str = ""
    suite: str = ""
    controllers: tuple[str, ...] = ("",)


def files_of(folder: Path, suite: Path | None) -> Files | None:
    """The files of a run; None if its tests cannot be hashed.

    Args:
        folder: Folder of the run.
        suite: Folder with the user's own tests.

    Raises:
        OSError: A file cannot be read.
    """
    tests = "" if suite is None else tree_sha256(suite)
    if tests is None:
        return None
    template, controller = folder / PROMPT_FILE, folder / "controller.py"
    for file in (template, controller):
        check_inside(folder, file)
    return Files(
        sha256_of_file(template) if template.is_file() else "",
        tests,
        (sha256_of_file(controller) if controller.is_file() else "",),
    )


@dataclass(slots=True)
class MarkedJournal:
    """A journal that is written, with the hash of its content.

    Attributes:
        file: The journal.
        about: Id of the run.
        size: Bytes of its whole lines.
    """

    file: Path
    about: str
    size: int = 0
    _hash: Any = field(default_factory=hashlib.sha256)

    @classmethod
    def of(cls, run: Run) -> MarkedJournal:
        """The journal of a run, which may not exist yet."""
        journal = cls(run.folder / JOURNAL, run.id)
        journal._add(lines_of(run.folder))
        return journal

    @property
    def sha256(self) -> str:
        """Hash of its content."""
        return str(self._hash.hexdigest())

    def append(self, record: JournalRecord, *, marked: bool) -> None:
        """Appends a record; if `marked`, its mark is written first.

        Raises:
            OSError: The write failed; the error names the file.
        """
        line = line_of(record)
        if marked:
            after = self._hash.copy()
            after.update(line)
            self._add_mark("journal", after.hexdigest())
        append_line(self.file, line)
        self._add(line)

    def vouch(self, file: Path) -> None:
        """Marks a file that this run has written, as it is now."""
        self._add_mark("file", sha256_of_file(file))

    def vouches(self, file: Path) -> bool:
        """Whether this run has written a file as it is now."""
        try:
            return _knows(self.file.parent, self.about, "file", sha256_of_file(file))
        except OSError:
            return False

    def _add_mark(self, what: str, sha256: str) -> None:
        line = f"{_further_mark(self.about, what, sha256)}\n".encode()
        append_line(self.file.parent / MARKS, line)

    def _add(self, content: bytes) -> None:
        self._hash.update(content)
        self.size += len(content)


def wrote(run: Run, content: bytes) -> bool:
    """Whether a run has written a file with this content, by the marks in its folder.

    Nothing of a run of another installation is; and nothing if no secret can be kept,
    except what this process has written.
    """
    return _knows(run.folder, run.id, "file", sha256_of(content))


def lines_of(folder: Path) -> bytes:
    """The whole lines of the journal of a run; nothing for a missing file.

    Raises:
        OSError: It cannot be read.
    """
    try:
        return whole_lines(read_inside(folder, JOURNAL, JOURNAL_BYTES))
    except FileNotFoundError:
        return b""


def mark_of(run: Run, files: Files, journal: MarkedJournal) -> str:
    """The mark of a run of this installation; empty if no secret can be kept."""
    if lasting_secret() is None:
        return ""
    macs = {
        _mac(run, files, controller, journal.sha256): None
        for controller in files.controllers
    }
    return f"{VERSION}:{journal.size}:{','.join(macs)}"


def is_marked(run: Run, suite: Path | None) -> bool:
    """Whether the mark of a run holds for its record and for what its folder has.

    Args:
        run: The run as recorded.
        suite: Folder with the tests of its task, as recorded.
    """
    found = _MARK.fullmatch(run.mark)
    if found is None or lasting_secret() is None:
        return False
    size, macs = int(found[1]), found[2].split(",")
    try:
        files, lines = files_of(run.folder, suite), lines_of(run.folder)
    except OSError:
        return False
    if files is None or size > len(lines):
        return False
    (controller,) = files.controllers
    mac = _mac(run, files, controller, sha256_of(lines[:size]))
    if not any(hmac.compare_digest(mac, each) for each in macs):
        return False
    if size == len(lines):
        return True
    return _knows(run.folder, run.id, "journal", sha256_of(lines))


def _knows(folder: Path, about: str, what: str, sha256: str) -> bool:
    """Whether `run.marks` has the mark of a journal or a file."""
    try:
        known = read_inside(folder, MARKS, JOURNAL_BYTES).split(b"\n")
    except OSError:
        return False
    return _further_mark(about, what, sha256).encode() in known


def _further_mark(about: str, what: str, sha256: str) -> str:
    return keyed(f"run {what}|{about}|{sha256}".encode()).hex()


def _mac(run: Run, files: Files, controller: str, journal_sha256: str) -> str:
    facts = {
        "record": _written(run),
        "template": files.template,
        "suite": files.suite,
        # Before a run has delivered one, there may be a file that it is about to.
        "controller": "" if run.tau is None else controller,
        "journal": journal_sha256,
    }
    return keyed(f"run|{VERSION}|{json.dumps(facts, sort_keys=True)}".encode()).hex()


def _written(run: Run) -> dict[str, Any]:
    """A record as it is read again; later versions may add fields with defaults."""
    content = json.loads(run.model_dump_json())
    again = Run.model_validate({**content, "folder": run.folder})
    return again.model_dump(mode="json", exclude={"mark"}, exclude_defaults=True)
