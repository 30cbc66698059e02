"""Webots worlds that somebody else offers."""

from __future__ import annotations

from offered_maps import link, pipe, text
from offers import Maker, Offer

HEADER = "#VRML_SIM R2025a utf8\n"
ROOM = "RectangleArena { floorSize 1 1 }\nE-puck { }\n"


def world(content: str) -> Maker:
    """A world of some nodes."""
    return text("w.wbt", HEADER + content)


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
]
