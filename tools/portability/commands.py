"""Runs commands with live output, and describes how they ended."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from table import RowFailed

KEPT_LINES = 400
# pytest's closing line, with colours or without.
CLOSING = re.compile(
    r"(\d+ (?:passed|failed|error|skipped|deselected).*?)(?: in [\d.]+s.*)?$"
)


def run(
    words: Sequence[object],
    *,
    cwd: Path,
    env: Mapping[str, str] | None = None,
    user: int | None = None,
    expect: int = 0,
) -> str:
    """Runs a command, prints its output and returns the end of it.

    Args:
        words: The command.
        cwd: Working folder.
        env: Environment; by default that of this process.
        user: User and group id to run it as, without further groups.
        expect: Expected exit code.

    Raises:
        RowFailed: The exit code is another one.
    """
    command = [str(word) for word in words]
    print(f"$ {' '.join(command)}", flush=True)
    identity: dict[str, Any] = {}
    if user is not None:
        identity = {"user": user, "group": user, "extra_groups": []}
    kept: deque[str] = deque(maxlen=KEPT_LINES)
    with subprocess.Popen(
        command,
        cwd=cwd,
        env=env,
        text=True,
        errors="replace",
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        **identity,
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            sys.stdout.write(line)
            sys.stdout.flush()
            kept.append(line.rstrip())
    text = "\n".join(kept)
    if process.returncode != expect:
        raise RowFailed(
            f"{' '.join(command[-4:])}: {ending(process.returncode)}{last(text)}"
        )
    return text


def ending(code: int) -> str:
    """An exit code in words; shells report a signal as 128 plus its number."""
    number = -code if code < 0 else code - 128 if code > 128 else 0
    if number in set(signal.Signals):
        return f"ended by {signal.Signals(number).name}"
    return f"exit {code}"


def last(text: str) -> str:
    """The text after an exit code: pytest's counts, or the last line of output."""
    if counts := counted(text):
        return f", {counts}"
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return f": {lines[-1][:160]}" if lines else ""


def counted(text: str) -> str:
    """The counts in pytest's last summary line, or an empty text."""
    for line in reversed(text.splitlines()):
        if found := CLOSING.match(line.strip(" =")):
            return found[1]
    return ""


def without(environment: Mapping[str, str], *names: str) -> dict[str, str]:
    """An environment without these variables."""
    return {name: text for name, text in environment.items() if name not in names}


def own_environment(**more: str) -> dict[str, str]:
    """This process's environment with more variables."""
    return {**os.environ, **more}
