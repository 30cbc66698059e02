"""The maps and worlds from which a task can be made: bundled ones and files."""

from __future__ import annotations

import re
from pathlib import Path

from tdac_agent.studio.folder import FILES
from tdac_agent.studio.source_view import names_of
from tdac_envs.core.intake import TEXT_BYTES, read_file

YAML = ".yaml", ".yml"
PICTURES = ".png", ".jpg", ".jpeg", ".pgm", ".bmp", ".tif", ".tiff", ".webp"
OWN = (*PICTURES, *YAML, ".map", ".npy", ".wbt")
"""Endings of the files that may be one."""
MOST_FILES = 200


def sources_in(place: Path) -> list[str]:
    """Bundled maps and worlds, and files of the studio's folder, as `KIND: NAME`."""
    sources = [f"map: {name}" for name in names_of("map")]
    sources += [f"world: {name}" for name in names_of("world")]
    return sources + own_sources(place)


def own_sources(place: Path) -> list[str]:
    """Maps and worlds among the files of the studio's folder, as `KIND: PATH`."""
    folders = place, place / "maps", place / FILES
    files = sorted(path for folder in folders for path in folder.glob("*"))
    named = (source_of(place, path) for path in files[:MOST_FILES] if path.is_file())
    return [source for source in named if source is not None]


def is_source(path: Path) -> bool:
    """Whether a file may be a map or a world, by its ending."""
    return path.suffix.lower() in OWN


def source_of(place: Path, path: Path) -> str | None:
    """A file as `KIND: PATH`; None if it is none, or a `map.yaml` without its image."""
    suffix = path.suffix.lower()
    if not is_source(path) or (suffix in YAML and not _image_of(path)):
        return None
    kind = "world" if suffix == ".wbt" else "map"
    return f"{kind}: {path.relative_to(place)}"


def _image_of(path: Path) -> bool:
    """Whether a YAML file is that of a ROS map whose image is there."""
    try:
        text = read_file(path, TEXT_BYTES).decode("utf-8")
    except (OSError, ValueError):
        return False
    named = re.search(r"^image:\s*[\"']?([^\"'\n#]+)", text, re.MULTILINE)
    return bool(named and (path.parent / named[1].strip()).is_file())
