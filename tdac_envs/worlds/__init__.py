"""The Webots worlds that ship with the package."""

from __future__ import annotations

import difflib
from pathlib import Path

from tdac_envs.errors import WorldError

_FOLDER = Path(__file__).parent
_DEFAULT = "arena"


def bundled_worlds() -> tuple[str, ...]:
    """Names of the bundled worlds: the default one first, the others sorted."""
    names = {path.stem for path in _FOLDER.glob("*.wbt")}
    return (_DEFAULT, *sorted(names - {_DEFAULT}))


def world_file(source: str | Path) -> Path:
    """The file of a bundled world, or of a path.

    Raises:
        WorldError: There is neither; the message offers the closest name.
    """
    path = Path(source)
    if isinstance(source, str) and source in bundled_worlds():
        return _FOLDER / f"{source}.wbt"
    if path.exists() or path.suffix or len(path.parts) != 1:
        return path
    names = bundled_worlds()
    close = difflib.get_close_matches(str(source), names, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(names)}"
    raise WorldError(f"no bundled world is called {str(source)!r}; {hint}")
