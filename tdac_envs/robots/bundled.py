"""Robots that come with the package, and those of one's own."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from pydantic import ValidationError

from tdac_envs.core.errors import TaskError, first_problem, hint, one_line_reason
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.robots.robot_file import RobotFile

_FILES = Path(__file__).parent / "files"
_YAML = (".yaml", ".yml")


@lru_cache(maxsize=1)
def bundled_robots() -> tuple[str, ...]:
    """Names of the bundled robots."""
    return tuple(sorted(file.stem for file in _FILES.glob("*.yaml")))


def load_robot(name: str | Path) -> RobotFile:
    """The robot of a bundled name, or of the path of a robot file.

    Raises:
        TaskError: The robot does not exist, or its file is invalid.
    """
    if not isinstance(name, str | Path):
        raise TaskError(f"expected the name or path of a robot, got {name!r:.100}")
    if str(name) in bundled_robots():
        return _bundled(str(name))
    path = Path(name)
    if path.suffix.lower() in _YAML:
        return read_robot_file(path)
    known = bundled_robots()
    raise TaskError(
        f"unknown robot {str(name)!r}; expected {', '.join(known)} or the path of a "
        f"robot file (.yaml){hint(str(name), known)}"
    )


def placed_robot(name: str, base: Path) -> str | Path:
    """A robot that a file names: the path of a robot file is relative to its folder.

    Args:
        name: Bundled name or path of a robot file.
        base: Folder of the file that names it.
    """
    return base / name if name.lower().endswith(_YAML) else name


@lru_cache(maxsize=16)
def _bundled(name: str) -> RobotFile:
    return read_robot_file(_FILES / f"{name}.yaml")


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot file.

    Raises:
        TaskError: It cannot be read, or has an invalid or unknown key.
    """
    try:
        values = parse_yaml(read_file(path, TEXT_BYTES))
        if not isinstance(values, dict):
            raise ValueError("expected keys with values, such as `radius: 0.105`")
        return RobotFile.model_validate({"name": path.stem, **values})
    except ValidationError as error:
        raise TaskError(f"{path}: {first_problem(error, RobotFile)}") from None
    except OSError as error:
        raise TaskError(f"no robot file {str(path)!r}: {error.strerror}") from None
    except ValueError as error:
        raise TaskError(f"{path}: {one_line_reason(error)}") from None
