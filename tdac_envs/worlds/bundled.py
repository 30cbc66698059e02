"""The Webots worlds that ship with the package."""

from __future__ import annotations

from pathlib import Path

from tdac_envs.core.errors import WorldError, hint

_FOLDER = Path(__file__).parent / "files"
_DEFAULT = "arena"


def bundled_worlds() -> tuple[str, ...]:
    """Names of the bundled worlds: the default first, then the others, sorted."""
    names = {path.stem for path in _FOLDER.glob("*.wbt")}
    return (_DEFAULT, *sorted(names - {_DEFAULT}))


def world_file(source: str | Path) -> Path:
    """The path of the bundled world that `source` names, else `source` as a path.

    `maze.wbt` also names the bundled world `maze`, unless such a file exists.

    Raises:
        WorldError: There is no world of this name; the message suggests the closest.
    """
    path = Path(source)
    name = str(source).removesuffix(".wbt") if not path.exists() else str(source)
    if isinstance(source, str) and name in bundled_worlds():
        return _FOLDER / f"{name}.wbt"
    if path.exists() or path.suffix or len(path.parts) != 1:
        return path
    names = bundled_worlds()
    raise WorldError(
        f"no bundled world is called {str(source)!r}{hint(str(source), names)}; "
        f"expected one of {', '.join(names)}"
    )
