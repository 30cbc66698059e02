"""The configuration files that come with the package."""

from __future__ import annotations

from pathlib import Path

# A wheel has `configs` inside the package, a clone has it beside the package.
_HERE = Path(__file__).parents[1]
_FOLDERS = (_HERE / "configs", _HERE.parent / "configs")


def shipped(name: str) -> Path:
    """Returns the path of a file below `configs`; the file may not exist."""
    files = [folder / name for folder in _FOLDERS]
    return next((file for file in files if file.is_file()), files[0])


def shipped_names(pattern: str) -> list[str]:
    """Returns the names below `configs` that match a glob pattern, sorted."""
    found = {
        str(file.relative_to(folder))
        for folder in _FOLDERS
        for file in folder.glob(pattern)
    }
    return sorted(found)
