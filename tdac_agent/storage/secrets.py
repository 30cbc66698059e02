"""API keys: read from the environment, sent only in request headers."""

from __future__ import annotations

import ipaddress
import os
import re
import unicodedata
from urllib.parse import urlsplit, urlunsplit

from tdac_agent.errors import ProviderError

# The judge starts the controllers, so its environment must have no variable with such
# a name: on the weakest tier a controller can read it.
SECRET = re.compile("KEY|TOKEN|SECRET|PASSW|CREDENTIAL", re.IGNORECASE)
NO_KEY = "none"
SHORTEST_SECRET = 8
LONGEST_LINE = 300


def read_key(variable: str, vendor: str, *, needed: bool) -> str:
    """Returns the key in an environment variable, or `NO_KEY` if it may be missing.

    Raises:
        ProviderError: A needed key is missing, or the value cannot be a key.
    """
    key = os.environ.get(variable, "").strip()
    if not key and needed:
        raise ProviderError(
            f"no key for {vendor}: set the environment variable {variable}"
        )
    if not key.isascii() or not key.isprintable() or " " in key:
        raise ProviderError(
            f"{variable} is not a valid key: expected printable ASCII without spaces"
        )
    return key or NO_KEY


def is_safe_for_keys(url: str) -> bool:
    """Whether a key is safe on its way to a server: https, or this machine."""
    return urlsplit(url).scheme == "https" or is_loopback(url)


def is_loopback(url: str) -> bool:
    """Whether a URL is one of this machine."""
    host = urlsplit(url).hostname or ""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def without_secrets(text: str) -> str:
    """Replaces values of key-like environment variables with the variables' names."""
    for name, value in os.environ.items():
        secret = value.strip()
        if SECRET.search(name) and len(secret) >= SHORTEST_SECRET:
            text = text.replace(secret, f"[{name}]")
    return text


def public_url(url: str) -> str:
    """Returns a URL without user, password and query, for records."""
    try:
        parts = urlsplit(url)
        host = parts.netloc.rpartition("@")[2]
        return one_line(urlunsplit((parts.scheme, host, parts.path, "", "")))
    except ValueError:
        return "an invalid URL"


def one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """Returns external text as one short line without secrets, for messages."""
    line = without_secrets(" ".join(text.split()))
    line = "".join(c for c in line if unicodedata.category(c)[0] != "C")
    kept = re.sub(r"\s+", " ", line).strip()
    return kept if len(kept) <= longest else f"{kept[: longest - 1]}…"
