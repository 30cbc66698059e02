"""The pip command that adds an extra to this installation."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from importlib import metadata
from pathlib import Path
from urllib.parse import unquote, urlsplit

PACKAGE = "tdac"


def install_command(extra: str | None) -> str:
    """The command that installs an extra from the same source as this installation.

    pip records the source of a package unless it came from an index
    (PEP 610).

    Args:
        extra: Name of an extra in `pyproject.toml`, e.g. `sb3`; None for what belongs
            to every installation.
    """
    suffix = "" if extra is None else f"[{extra}]"
    return f"{_pip()} install {' '.join(_requirement(suffix))}"


def _pip() -> str:
    """The pip command of this interpreter."""
    found = shutil.which("pip")
    if found is not None and Path(found).parent == Path(sys.executable).parent:
        return "pip"
    return f"{shlex.quote(sys.executable)} -m pip"


def _requirement(extra: str) -> list[str]:
    """Arguments of `pip install` for this package with an extra such as `[sb3]`."""
    try:
        # raw read: shipped
        text = metadata.distribution(PACKAGE).read_text("direct_url.json")
    except metadata.PackageNotFoundError:
        text = None
    if text is None:
        return [shlex.quote(PACKAGE + extra)]
    origin = json.loads(text)
    url = origin["url"]
    if "dir_info" in origin:
        folder = unquote(urlsplit(url).path)
        editable = ["-e"] if origin["dir_info"].get("editable") else []
        return [*editable, shlex.quote(folder + extra)]
    system = f"{origin['vcs_info']['vcs']}+" if "vcs_info" in origin else ""
    return [shlex.quote(f"{PACKAGE}{extra} @ {system}{url}")]
