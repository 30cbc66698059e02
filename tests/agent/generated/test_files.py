"""Whatever one field of a file is, the file is read, or refused in one line."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from pathlib import Path

import pytest
from hostile_files import KINDS, Kind
from hostile_values import altered
from hypothesis import HealthCheck, given, settings

from tdac_envs.core.errors import TdacError

LONGEST = 20_000
"""Characters of a message, which may quote a name; the command line cuts it."""
SECONDS = 120
LEAST_SHARE = 0.5


def problem_of(kind: Kind, text: str, folder: Path) -> str:
    """What is wrong with how a file is taken; empty where nothing is."""
    kind.furnish(folder)
    (folder / kind.file).write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        kind.read(folder)
    except TdacError as error:
        message = str(error)
        if not message or len(message) > LONGEST:
            return f"a message of {len(message)} characters: {message[:300]!r}"
    except OSError as error:
        # The command line ends with one line for such a name.
        return "" if error.filename and error.errno in (36, 40) else repr(error)
    return ""


def check_kind(kind: Kind, examples: int, alarm) -> None:
    """Tries so many files of a kind; at least half get past the first check."""
    seen: Counter[bool] = Counter()

    @settings(
        max_examples=examples,
        suppress_health_check=list(HealthCheck),
        database=None,
        derandomize=examples < 1000,
    )
    @given(altered(kind.whole))
    def run(value):
        text = kind.text(value)
        seen[kind.gets_in(text)] += 1
        folder = Path(tempfile.mkdtemp(prefix="generated-"))
        alarm(SECONDS)
        try:
            assert problem_of(kind, text, folder) == ""
        finally:
            shutil.rmtree(folder)

    run()
    share = seen[True] / seen.total()
    assert share >= LEAST_SHARE, (
        f"{share:.0%} of {seen.total()} get past the first check"
    )


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_the_file_that_nobody_changed_is_read(kind, tmp_path):
    """Else the others would be refused for what is wrong with all of them."""
    kind.furnish(tmp_path)
    (tmp_path / kind.file).write_text(kind.text(kind.whole))
    kind.read(tmp_path)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_hostile_field_is_taken_or_refused_in_one_line(kind, alarm):
    """Of each kind of file some 25, 300 in all: no traceback, and soon."""
    check_kind(kind, 300 // len(KINDS) + 1, alarm)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_many_hostile_fields(kind, alarm):
    """The same for 10,000 files."""
    check_kind(kind, 10_000 // len(KINDS) + 1, alarm)
