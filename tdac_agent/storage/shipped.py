"""The configuration files that come with the package."""

from __future__ import annotations

from pathlib import Path

# In a wheel the files are beside this package's modules, in a clone at its top.
_HERE = Path(__file__).parents[1]
_FOLDERS = (_HERE / "configs", _HERE.parent / "configs")


def shipped(name: str) -> Path:
    """The file of this name below `configs`; it need not be there."""
    files = [folder / name for folder in _FOLDERS]
    return next((file for file in files if file.is_file()), files[0])


def shipped_names(pattern: str) -> list[str]:
    """The names below `configs` that match a pattern, in order."""
    found = {
        str(file.relative_to(folder))
        for folder in _FOLDERS
        for file in folder.glob(pattern)
    }
    return sorted(found)
