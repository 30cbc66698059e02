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
SAME: dict[str, str] = {
    # Ladder 1.0, on maps and on plates: one place where metres per px become units.
    "257622d0cece1bda6f810b0acc08d006128c7c0d9868e9b6d50f90509b230035": (
        "46a5299112cd13c1188f8899f0e1d9ef6aa22ac926b7f3b91c12e6dbe9ef96e7"
    ),
    "3a9981cc156b84cb0c5ea801a56bbe4e7d4c7f7f53f6e52e11a86b3e7732a776": (
        "bafe5cc4e1227b0fe28e68475a0256d2f75bf8119d7486d5d3bb1cba1f990dab"
    ),
    # Another physics can move the body; the exact step is what it was.
    "9acbc0c93768b50cba34e8fd49ba67ed4f0de8108832d90e685e678395391d38": (
        "46a5299112cd13c1188f8899f0e1d9ef6aa22ac926b7f3b91c12e6dbe9ef96e7"
    ),
    "a59539acbd749c472a5b0f8c6d39a1708280fd2238c35c7b14c21468abd9e00e": (
        "bafe5cc4e1227b0fe28e68475a0256d2f75bf8119d7486d5d3bb1cba1f990dab"
    ),
    # Another physics can measure rays; a set may have the worlds of another one.
    "c6b1a10ade57ec5dc04fe66d7a02b2cb036c7a91e443147df907b03cbae60eff": (
        "46a5299112cd13c1188f8899f0e1d9ef6aa22ac926b7f3b91c12e6dbe9ef96e7"
    ),
    "c0a38d48c7fc50f66242c2853fedf9e8f7cacc91e3325347a483601087c019e8": (
        "bafe5cc4e1227b0fe28e68475a0256d2f75bf8119d7486d5d3bb1cba1f990dab"
    ),
}
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
