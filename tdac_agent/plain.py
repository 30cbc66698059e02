"""An error message as a diagnosis quotes it."""

from __future__ import annotations

import re

MAX_MESSAGE = 300
_FOLDERS = re.compile(r"(?<![\w.])(?:/[\w.+-]+)+/(?=[\w.+-])")
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+|0x[0-9a-fA-F]{6,}")


def plain(message: str) -> str:
    """One bounded line, folders cut short, without addresses and full stop."""
    line = " ".join(_ADDRESS.sub("", _FOLDERS.sub("…/", message)).split()).rstrip(".")
    return line if len(line) <= MAX_MESSAGE else f"{line[:MAX_MESSAGE]} …"
