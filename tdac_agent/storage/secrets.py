"""Keys are read from the environment, and leave it only in a request's header."""

from __future__ import annotations

import ipaddress
import os
import re
import unicodedata
from urllib.parse import urlsplit, urlunsplit

from tdac_agent.errors import ProviderError

# The judge starts the controllers, so it holds no keys: on the weakest tier they may
# read its environment.
SECRET = re.compile("KEY|TOKEN|SECRET|PASSW|CREDENTIAL", re.IGNORECASE)
NO_KEY = "none"
SHORTEST_SECRET = 8
LONGEST_LINE = 300


def read_key(variable: str, vendor: str, *, needed: bool) -> str:
    """The key in an environment variable; a word in its place where none is needed.

    Raises:
        ProviderError: There is none.
    """
    key = os.environ.get(variable, "").strip()
    if not key and needed:
        raise ProviderError(
            f"no key for {vendor}: set the environment variable {variable}"
        )
    if not key.isascii() or not key.isprintable() or " " in key:
        raise ProviderError(f"the value of {variable} is no key: it has odd characters")
    return key or NO_KEY


def keeps_secrets(url: str | None) -> bool:
    """Whether nobody on the way to a server can read along: https, or this machine."""
    if url is None:
        return True
    parts = urlsplit(url)
    host = parts.hostname or ""
    if parts.scheme == "https" or host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def without_secrets(text: str) -> str:
    """A text in which no value of a variable that looks like a key is left."""
    for name, value in os.environ.items():
        secret = value.strip()
        if SECRET.search(name) and len(secret) >= SHORTEST_SECRET:
            text = text.replace(secret, f"[{name}]")
    return text


def public_url(url: str) -> str:
    """An address without user, password and query, for records."""
    try:
        parts = urlsplit(url)
        host = parts.netloc.rpartition("@")[2]
        return one_line(urlunsplit((parts.scheme, host, parts.path, "", "")))
    except ValueError:
        return "an address that is none"


def one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """A text from elsewhere as one short line, for messages and records."""
    line = without_secrets(" ".join(text.split()))
    line = "".join(c for c in line if unicodedata.category(c)[0] != "C")
    kept = re.sub(r"\s+", " ", line).strip()
    return kept if len(kept) <= longest else f"{kept[: longest - 1]}…"
