"""Texts of Webots worlds, and how to break them."""

from __future__ import annotations

import random
import re

ARENA = """CircleArena {
  radius 0.8
}
"""
EPUCK = """E-puck {
  translation -0.4 0.1 0
  rotation 0 0 1 0.5
  controller "none"
}
"""
EVERYTHING = """#VRML_SIM R2023b utf8
# a comment, "with quotes" { and braces

EXTERNPROTO "https://raw.githubusercontent.com/cyberbotics/webots/R2023b/E-puck.proto"
IMPORTABLE EXTERNPROTO "webots://projects/objects/Rock.proto"

WorldInfo {
  info [ "one" "t\\"wo\\\\" ]
  basicTimeStep 16
}
Viewpoint { position 0, 0, 3 }
RectangleArena { rotation 0 0 1 0.3 floorSize 2 1.5 wallHeight 0.05 }
DEF E-PUCK E-puck {
  hidden position_0_0 25.6
  hidden rotation_1 0 1 0 .5
  translation -.5 0.1 -6e-05
  rotation 0.1 0.2 -0.99 3
  turretSlot [ GPS { } Compass { } ]
}
E-puck { name "other" translation 0.6 0.5 0 version "2" }
WoodenBox { translation 0.2 0.3 0.05 size 0.1 0.2 0.1 mass 0.5 }
CardboardBox { translation 0.2 -0.3 0.1 rotation 1 0 0 0.4 size 0.2 0.2 0.2 }
PlasticCrate { translation 0.9 0 0 size 0.2 0.1 0.1 }
WoodenPallet { translation 0 0.6 0 size 0.3 0.2 0.05 boundingObject FALSE }
SolidBox { translation -0.8 -0.5 0.05 size 0.1 0.1 0.1 physics Physics { } }
Wall { translation -0.2 0.5 0 rotation 0 0 1 1.5708 size 0.02 0.4 0.1 }
Rock { translation 0.5 -0.5 0 scale 2 }
Rock { translation 0.8 -0.5 0 type "flat" scale 0.5 }
OilBarrel { translation -0.9 0.5 0.1 height 0.2 radius 0.05 }
TrafficCone { translation 5 5 0 }
SolidPipe { translation 0 -0.6 0.1 height 0.2 radius 0.1 thickness 0.02 }
Floor { translation 0 0 0.001 size 1 1 }
CustomThing { translation 0.1 0.1 0 extensionSlot [ Solid { } ] flavour "odd" }
Robot { name "supervisor" supervisor TRUE children [ Emitter { } ] }
Group { children [
  Transform { translation 0 0 0.1 scale 2 2 1 children [
    DEF BODY Solid {
      translation 0.1 0.1 0
      children [
        DEF LOOK Shape {
          appearance PBRAppearance { baseColor 0.5 0 0 roughness 0.5 metalness 0 }
          geometry DEF BALL Sphere { radius 0.03 }
        }
        Solid { name "inner" boundingObject Cylinder { radius 0.02 height 0.1 } }
      ]
      name "ball"
      boundingObject Group { children [
        USE BALL
        Pose { translation 0 0 0.05 rotation 0 1 0 0.7 children [
          Shape { geometry Capsule { radius 0.01 height 0.05 } } Box { size 1 0.1 0.1 }
        ] }
      ] }
      physics Physics { density -1 mass 0.2 }
    }
  ] }
  Shape { geometry Cone { bottomRadius 0.05 height 0.1 } }
] }
Solid {
  name "wedge"
  boundingObject DEF WEDGE IndexedFaceSet {
    coord Coordinate { point [ 0 0 0, 0.1 0 0, 0 0.1 0, 0 0 0.1 ] }
    coordIndex [ 0, 1, 2, -1, 0, 1, 3, -1, 0, 2, 3, -1, 1, 2, 3, -1 ]
  }
}
DEF WEDGE Solid { boundingObject USE WEDGE }
HingeJoint { endPoint Solid { name "door" boundingObject Box { size 0.1 0.01 0.1 } } }
DEF GOAL Solid {
  translation 0.5 0.2 0.02
  children [ Shape { geometry Sphere { radius 0.05 } } ]
}
"""

OLD = """#VRML_SIM V8.5 utf8
WorldInfo { gravity 0 -9.81 0 }
Background { skyColor [ 0.4 0.7 1 ] }
RectangleArena { floorSize 1 2 }
DEF e-puck E-puck { translation 0.1 0 -0.2 rotation 0 1 0 1.57 }
WoodenBox { translation 0.3 0.05 0.2 rotation 0 1 0 0.3 size 0.1 0.1 0.2 }
Wall { translation -0.3 0 0.2 size 0.4 0.1 0.02 }
DEF wall Solid {
  children [ DEF S Shape { geometry Box { size 0.01 0.1 0.3 } } ]
  boundingObject USE S
}
DEF wall Solid { translation 0 0 0.5 boundingObject USE S }
"""


def text(*nodes: str, version: str = "R2025a", info: str = "") -> str:
    """A file with some nodes."""
    return "\n".join([f"#VRML_SIM {version} utf8", f"WorldInfo {{ {info} }}", *nodes])


def mutated(source: str, rng: random.Random) -> str:
    """A text with one to three random changes."""
    for _ in range(rng.randint(1, 3)):
        source = rng.choice(_CHANGES)(source, rng)
    return source


def _cut(source: str, rng: random.Random) -> str:
    at = rng.randint(0, len(source))
    return source[:at] + source[at + rng.randint(1, 60) :]


def _cut_off(source: str, rng: random.Random) -> str:
    return source[: rng.randint(0, len(source))]


def _insert(source: str, rng: random.Random) -> str:
    at = rng.randint(0, len(source))
    return source[:at] + rng.choice(_PIECES) + source[at:]


def _swap(source: str, rng: random.Random) -> str:
    words = re.split(r"(\s+)", source)
    one, other = rng.randrange(len(words)), rng.randrange(len(words))
    words[one], words[other] = words[other], words[one]
    return "".join(words)


def _number(source: str, rng: random.Random) -> str:
    numbers = list(re.finditer(r"(?<=\s)[-+.\d][-+.\deE]*", source))
    if not numbers:
        return source
    chosen = rng.choice(numbers)
    return source[: chosen.start()] + rng.choice(_NUMBERS) + source[chosen.end() :]


def _repeat(source: str, rng: random.Random) -> str:
    at = rng.randint(0, len(source))
    piece = source[at : at + rng.randint(1, 400)]
    return source[:at] + piece * rng.randint(2, 5) + source[at + len(piece) :]


def _character(source: str, rng: random.Random) -> str:
    at = rng.randint(0, max(len(source) - 1, 0))
    return source[:at] + chr(rng.choice([0, 13, 34, 92, 255, 8232])) + source[at + 1 :]


_CHANGES = [_cut, _cut_off, _insert, _swap, _repeat, _character, *[_number] * 8]
_NUMBERS = [
    *(
        "0",
        "-1",
        "2",
        "-3.7",
        "0.5",
        "1e5",
        "-1e5",
        "1e-5",
        "1e-9",
        "1e-300",
        "24",
        "-0.0",
    ),
    *("1e300", "1e999", "nan", "99999999", "0.1.2"),
]
_PIECES = [
    "{", "}", "[", "]", '"', "#", "DEF A", "USE BODY", "USE WEDGE", "NULL", "TRUE",
    "IS x", " 1 2 3 ", "Group { children [ ", "] }", "\r", "hidden", "PROTO",
    "EXTERNPROTO",
    "Solid { boundingObject USE BALL }", "scale 0 0 0", "rotation 0 0 0 0", "\x00",
    "size 1e6 1e-9 1", "{" * 300, "Solid { children [ " * 150, "coordIndex [ 0 1 9 ]",
]  # fmt: skip
