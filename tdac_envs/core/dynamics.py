"""The hash of the code that decides what happens in an episode.

It is the same on all machines, systems and versions of Python, in a clone and in an
installed package. Comments, docstrings and blank lines do not count.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

from tdac_envs.core.hashing import sha256_of

PACKAGE = Path(__file__).parents[1]
STEP = ("core/compiled.py", "drive", "grid", "mapping/ray_angles.py", "movers")
"""Code that both robots share."""
ON_MAPS = (*STEP, "map2d")
IN_WORLDS = (
    *(*STEP, "epuck", "worlds/bodies.py", "worlds/footprint.py"),
    *("worlds/materials.py", "worlds/world.py"),
)
"""Code of tasks of an e-puck.

How a world file is read does not count: the hash of a task covers what was read.
"""
NEUTRAL = (
    *("picture.py", "drive/frames.py"),  # what is drawn
    *("vector.py", "batching.py", "rewards.py", "ladder/pool.py"),  # training alone
    "ladder/frozen.py",  # has the hashes
)
"""Ends of the paths of files that decide nothing in an episode of a controller."""
SAME: dict[str, str] = {}
"""Hashes of changed code, each with that of earlier code with the same dynamics.

For a change that moves no number of any episode, such as another name. Results on the
earlier code then stay valid. `python -m tools.frozen --drive` compares episodes.
"""
_SPLIT = re.compile(
    r"""
      (?P<text> ^[ \t]*[rR]?\"{3}(?:[^"\\]|\\.|"(?!""))*\"{3}[ \t]*$ )
    | \"{3}(?:[^"\\]|\\.|"(?!""))*\"{3} | '{3}(?:[^'\\]|\\.|'(?!''))*'{3}
    | "(?:[^"\\\n]|\\.)*" | '(?:[^'\\\n]|\\.)*'
    | (?P<comment> \#[^\n]* )
    """,
    re.VERBOSE | re.MULTILINE | re.DOTALL,
)


@functools.cache
def code_sha256(*parts: str) -> str:
    """Hash of code of this package, in 64 hexadecimal digits.

    Args:
        *parts: Folders and files below `tdac_envs`, such as `map2d`.
    """
    hashes = [
        # raw read: shipped
        f"{name} {sha256_of(code_of((PACKAGE / name).read_text('utf-8')))}\n"
        for name in files_of(*parts)
    ]
    found = sha256_of(*hashes)
    return SAME.get(found, found)


def files_of(*parts: str) -> list[str]:
    """The files of some code, relative to the package, in order."""
    places = [PACKAGE / part for part in parts]
    files = [
        file
        for place in places
        for file in (place.rglob("*.py") if place.is_dir() else [place])
    ]
    names = {file.relative_to(PACKAGE).as_posix() for file in files}
    return sorted(name for name in names if not name.endswith(NEUTRAL))


def code_of(source: str) -> str:
    """The source of a module without comments, docstrings and blank lines.

    A text between three double quotes that stands on lines of its own is a docstring:
    no other one does in formatted code.
    """
    lines = _SPLIT.sub(_kept, source.replace("\r\n", "\n")).split("\n")
    return "\n".join(line.rstrip() for line in lines if line.strip())


def _kept(found: re.Match[str]) -> str:
    return "" if found["text"] or found["comment"] else found[0]
