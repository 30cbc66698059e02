"""A wheel of this installation, as files of a Harbor task need one."""

from __future__ import annotations

import base64
import re
import zipfile
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path

from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.shipped import shipped, shipped_names

PACKAGE = "tdac"
ROOT = Path(__file__).parents[2]
PARTS = ("tdac_envs", "tdac_agent")
CONFIGS = "tdac_agent/configs"
FACTS = ("METADATA", "entry_points.txt", "licenses/LICENSE")
TAG = "py3-none-any"


def write_wheel(folder: Path) -> Path:
    """Packs the installed packages, a clone's or a wheel's, as a wheel.

    Nothing is built or downloaded. The same files give the same wheel.

    Args:
        folder: An existing folder.
    """
    installed = distribution(PACKAGE)
    stem = f"{PACKAGE}-{installed.version}"
    info = f"{stem}.dist-info"
    files = dict(_sources())
    for name in FACTS:
        # raw read: shipped
        files[f"{info}/{name}"] = (installed.read_text(name) or "").encode()
    files[f"{info}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: tdac\nRoot-Is-Purelib: true\nTag: {TAG}\n"
    ).encode()
    record = [f"{name},{_hash(raw)},{len(raw)}\n" for name, raw in files.items()]
    record.append(f"{info}/RECORD,,\n")
    files[f"{info}/RECORD"] = "".join(record).encode()
    path = folder / f"{stem}-{TAG}.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, raw in files.items():
            wheel.writestr(_entry(name), raw)
    return path


def pinned_versions() -> str:
    """The installed versions of what tdac needs, as constraints for pip."""
    needed = distribution(PACKAGE).requires or []
    names = {_name(line) for line in needed if "extra ==" not in line}
    return "".join(f"{name}=={distribution(name).version}\n" for name in sorted(names))


def _name(requirement: str) -> str:
    match = re.match(r"[\w.-]+", requirement)
    assert match is not None
    return match[0]


def _sources() -> Iterator[tuple[str, bytes]]:
    """The files of the packages, with the configurations inside, as in any wheel."""
    for part in PARTS:
        for file in sorted((ROOT / part).rglob("*")):
            name = file.relative_to(ROOT)
            is_made = "__pycache__" in name.parts or name.is_relative_to(CONFIGS)
            if file.is_file() and not is_made:
                yield name.as_posix(), file.read_bytes()  # raw read: shipped
    for config in shipped_names("**/*"):
        if shipped(config).is_file():
            # raw read: shipped
            yield f"{CONFIGS}/{config}", shipped(config).read_bytes()


def _hash(raw: bytes) -> str:
    digest = base64.urlsafe_b64encode(bytes.fromhex(sha256_of(raw)))
    return f"sha256={digest.decode().rstrip('=')}"


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry with a constant date and ordinary permissions."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    return entry
