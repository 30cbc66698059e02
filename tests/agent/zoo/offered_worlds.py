"""Webots worlds and projects that somebody else offers."""

from __future__ import annotations

import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from offered_maps import link, pipe, text
from offers import Maker, Offer

HEADER = "#VRML_SIM R2025a utf8\n"
ROOM = "RectangleArena { floorSize 1 1 }\nE-puck { }\n"


def world(content: str) -> Maker:
    """A world of some nodes."""
    return text("w.wbt", HEADER + content)


CONTROLLER = """import os, sys
from controller import Robot
for place in (".", "../.."):
    for top, _, names in os.walk(place):
        for name in names:
            with open(os.path.join(top, name), "rb") as file:
                assert b"not for " + b"controllers" not in file.read(), name
import json, random, numpy
Robot().step(32)
"""
SECRET = "not for controllers"


def project(more: Callable[[Path], object]) -> Maker:
    """A Webots project with a controller that looks for a file outside of it."""

    def make(here: Path) -> None:
        (here / "secrets").mkdir(parents=True)
        (here / "secrets" / "key.py").write_text(SECRET)
        for folder in ("worlds", "libraries", "controllers/c", "controllers/other"):
            (here / "p" / folder).mkdir(parents=True)
        (here / "p" / "worlds" / "w.wbt").write_text(HEADER + ROOM)
        (here / "p" / "controllers" / "c" / "c.py").write_text(CONTROLLER)
        more(here / "p")

    return make


def _leading_out(root: Path) -> None:
    """Links to files, folders and the root, in each folder that is copied."""
    for folder in ("libraries", "controllers", "controllers/c", "controllers/other"):
        (root / folder / "key.py").symlink_to(root.parent / "secrets" / "key.py")
        (root / folder / "keys").symlink_to("../" * folder.count("/") + "../../secrets")
        (root / folder / "all").symlink_to("/")


def _in_a_home(root: Path) -> None:
    """The project's folder has other files, to which it links."""
    (root / ".keys").write_text(SECRET)
    (root / "libraries" / "key.py").symlink_to("../.keys")
    (root / "controllers" / "other" / "key.py").symlink_to("../../.keys")
    (root / "controllers" / "c" / "home").symlink_to("../..")


def _library_link(root: Path) -> None:
    (root / "libraries").rmdir()
    (root / "libraries").symlink_to("/")


def _in_circles(root: Path) -> None:
    (root / "libraries" / "itself").symlink_to("itself")
    for name in "abcde":
        (root / "libraries" / name).symlink_to("..")
        (root / "controllers" / "other" / name).symlink_to("../..")


def _pipes(root: Path) -> None:
    for folder in ("libraries", "controllers/c", "controllers/other"):
        os.mkfifo(root / folder / "pipe.py")


def _traps(root: Path) -> None:
    for name in ("json", "random", "numpy", "controller", "sitecustomize", "os"):
        (root / "libraries" / f"{name}.py").write_text("raise SystemExit('trap')")


def _huge(place: str) -> Callable[[Path], object]:
    def make(root: Path) -> None:
        with (root / place).open("wb") as file:
            file.truncate(1 << 30)

    return make


def _many(root: Path) -> None:
    for number in range(11_000):
        (root / "libraries" / f"m{number}.py").touch()


def _escapes(root: Path) -> None:
    name = "\x1b[2J\x07\n"
    (root / "libraries" / name).mkdir()
    (root / "libraries" / f"{name}.py").symlink_to("/etc/hostname")


def _closed(root: Path) -> None:
    for folder in ("libraries", "controllers/other"):
        (root / folder).chmod(0)


def _project(
    name: str, more: Callable[[Path], object], says: str = "", code: int = 0
) -> Offer:
    words = ("webots", "run", "p/controllers/c/c.py", "p/worlds/w.wbt", "--steps", "2")
    return Offer("projects", name, words, project(more), says, code)


def _driven(name: str, content: str, says: str, robot: str = "E-puck { }") -> Offer:
    """A world that a controller is to drive in."""

    def more(root: Path) -> None:
        walls = "RectangleArena { floorSize 1 1 }\n"
        (root / "worlds" / "w.wbt").write_text(HEADER + walls + content + robot)

    return _project(name, more, says, 2)


DEVICES = " ".join(f'Pen {{ name "{"n" * 300}{k}" }}' for k in range(3000))
FIELDS = " ".join(f"{'x' * 20}{k} {k}" for k in range(100_000))
PROJECTS = [
    _project("leading-out", _leading_out),
    _project("in-a-home", _in_a_home),
    _project("library-link", _library_link),
    _project("circles", _in_circles),
    _project("pipes", _pipes),
    _project("traps", _traps),
    _project("huge-library", _huge("libraries/data.bin")),
    _project("huge-beside", _huge("controllers/c/data.bin"), "more than 64 MB", 2),
    _project("many", _many),
    _project("escapes", _escapes),
    _project("closed", _closed),
    _driven("devices", "", "too large", f"E-puck {{ turretSlot [ {DEVICES} ] }}"),
    _driven("fields", f"Wall {{ {FIELDS} }}\n", "no e-puck", ""),
    _driven("one-field", "Wall { x 1 }\n" * 9000, "no e-puck", ""),
    _driven(
        "number", "", "a string for name", "E-puck { turretSlot [ GPS { name 3 } ] }"
    ),
    _driven("absolute", "../../etc/passwd { }", "expected a number"),
    _driven("escape", "Wall { \x1b]0;x\x07 1 }", "expected"),
    _driven(
        "scales", "Transform { scale 9 9 9 children [ " * 60, "a value of children"
    ),
]


def _offer(name: str, make: Maker, says: str, endless: bool = False) -> Offer:
    return Offer("worlds", name, ("world", "w.wbt"), make, says, endless=endless)


OFFERS = [
    _offer("endless", link("w.wbt", "/dev/zero"), "not a regular file", True),
    _offer("pipe", pipe("w.wbt"), "not a regular file", True),
    _offer("large", text("w.wbt", b" " * 8_000_001), "larger than 8 MB"),
    _offer("deep", world("Group { children [ " * 3000), "at most 100 nested nodes"),
    _offer("digits", world(f"WorldInfo {{ basicTimeStep {'9' * 5000} }}"), "number"),
    _offer("far", world("E-puck { translation 1e300 0 0 }"), "beyond 1e\\+06"),
    _offer("nan", world("E-puck { translation nan 0 0 }"), "after nan"),
    _offer(
        "thin", world("Solid { children [ Shape { geometry Sphere { radius -1e9"), ""
    ),
    _offer("string", world('E-puck { name "never closed'), "not closed"),
    _offer("itself", world("DEF A Group { children [ USE A ] }"), "no DEF A before it"),
    _offer(
        "doubled",
        world(
            "DEF A Group { children [ Wall { x 1 } ] }\n"
            + "".join(
                f"DEF {b} Group {{ children [ USE {a} USE {a} USE {a} ] }}\n"
                for a, b in pairwise("ABCDEFGHIJKL")
            )
        ),
        "at most 20000 nodes",
    ),
    *PROJECTS,
]
