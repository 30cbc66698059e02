"""The nodes of a file as a supervisor sees them, and the fields that it may write."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from tdac_envs.worlds.wbt.household import HOUSEHOLD
from tdac_envs.worlds.wbt.robots import ROBOTS, is_epuck
from tdac_envs.worlds.wbt.tree import Item, WbtField, WbtNode

SF_BOOL, SF_INT32, SF_FLOAT, SF_VEC2F, SF_VEC3F = 1, 2, 3, 4, 5
SF_ROTATION, SF_COLOR, SF_STRING, SF_NODE, MF = 6, 7, 8, 9, 16

# A file does not state field types; those below do not follow from the values.
_LISTS = {
    **dict.fromkeys(
        ("children", "device", "turretSlot", "groundSensorsSlot", "bodySlot"),
        MF + SF_NODE,
    ),
    **dict.fromkeys(("controllerArgs", "info", "url", "remoteUrl"), MF + SF_STRING),
    **dict.fromkeys(("coordIndex", "texCoordIndex", "normalIndex"), MF + SF_INT32),
    **dict.fromkeys(("point", "vector"), MF + SF_VEC3F),
}
_INTEGERS = {"subdivision", "numberOfRays", "distance_sensor_numberOfRays", "FPS"}
_WIDTH = {SF_VEC2F: 2, SF_VEC3F: 3, SF_ROTATION: 4, SF_COLOR: 3}

_SOLID_PROTOS: dict[str, dict[str, Any]] = {
    "CardboardBox": {"translation": [0.0, 0.0, 0.3], "size": [0.6, 0.6, 0.6]},
    "CircleArena": {"radius": 1.0, "wallThickness": 0.01, "wallHeight": 0.1},
    "Floor": {"size": [10.0, 10.0]},
    "OilBarrel": {"translation": [0.0, 0.0, 0.44], "height": 0.88, "radius": 0.305},
    "PlasticCrate": {"size": [0.6, 0.6, 0.6]},
    "RectangleArena": {"floorSize": [1.0, 1.0], "wallHeight": 0.1},
    "Rock": {"scale": 1.0, "type": "regular"},
    "SolidBox": {"translation": [0.0, 0.0, 1.0], "size": [2.0, 2.0, 2.0]},
    "SolidPipe": {"translation": [0.0, 0.0, 1.0], "height": 2.0, "radius": 1.0},
    "TrafficCone": {},
    "Wall": {"size": [0.2, 1.0, 2.4]},
    "WoodenBox": {"translation": [0.0, 0.0, 0.3], "size": [0.6, 0.6, 0.6]},
    "WoodenPallet": {"size": [1.2, 0.8, 0.14]},
}
_NAMES = {
    "CardboardBox": "cardboard box", "CircleArena": "circle arena", "Floor": "floor",
    "OilBarrel": "oil barrel", "PlasticCrate": "plastic crate",
    "RectangleArena": "rectangle arena", "Rock": "rock", "SolidBox": "box",
    "SolidPipe": "pipe", "TrafficCone": "traffic cone", "Wall": "wall",
    "WoodenBox": "wooden box", "WoodenPallet": "wooden pallet", "E-puck": "e-puck",
    "Solid": "solid", "Robot": "robot",
}  # fmt: skip
_BACKGROUNDS = {
    "TexturedBackground": "Background",
    "TexturedBackgroundLight": "DirectionalLight",
}
_POSE = {"translation": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 1.0, 0.0]}
_ROBOT_FIELDS: dict[str, Any] = {
    "controller": "<generic>",
    "controllerArgs": [],
    "customData": "",
    "supervisor": False,
    "synchronization": True,
}

_FREE_FIELDS = {
    "customData", "description", "diffuseColor", "baseColor", "emissiveColor",
    "transparency", "title", "recognitionColors", "model",
}  # fmt: skip
_FREE_NODES = {
    "Background", "DirectionalLight", "Fog", "PointLight", "SpotLight", "Viewpoint",
    "WorldInfo",
}  # fmt: skip


@dataclass(slots=True)
class SceneNode:
    """A node.

    Attributes:
        kind: Node or PROTO type.
        base: Node type; for a PROTO, its base type.
        define: DEF name, or empty.
        parent: Number of the parent node; -1 for the root.
        fields: Name, type and value of each field; nodes as their numbers.
    """

    kind: str
    base: str
    define: str
    parent: int
    fields: list[list[Any]]

    def plain(self) -> tuple[Any, ...]:
        """The node as it is sent to the controller."""
        return self.kind, self.base, self.define, self.parent, self.fields


class NodeTable:
    """All nodes of a file; number 0 is the root.

    Args:
        nodes: Top-level nodes of the file.
    """

    def __init__(self, nodes: Iterable[WbtNode]) -> None:
        self.nodes = [SceneNode("Group", "Group", "", -1, [])]
        self._numbers: dict[int, int] = {}
        children = [self._add(node, 0) for node in nodes]
        self.nodes[0].fields.append(["children", MF + SF_NODE, children])

    def number(self, node: WbtNode) -> int:
        """Number of one of the file's nodes."""
        return self._numbers[id(node)]

    def has(self, number: int, field: str) -> bool:
        """Whether a node exists and, unless `field` is empty, has this field."""
        if not 0 <= number < len(self.nodes):
            return False
        names = [name for name, _, _ in self.nodes[number].fields]
        return not field or field in names

    def may_write(self, number: int, field: str) -> bool:
        """Whether a field may be written in a judged run, since that moves nothing."""
        return self.nodes[number].base in _FREE_NODES or field in _FREE_FIELDS

    def describe(self, number: int) -> str:
        """A short description of a node for messages."""
        node = self.nodes[number]
        if node.define:
            return f"DEF {node.define} {node.kind}"
        names = [value for name, _, value in node.fields if name == "name"]
        return f'{node.kind} "{names[0]}"' if names else node.kind

    def _add(self, node: WbtNode, parent: int) -> int:
        if id(node) in self._numbers:  # a USE
            return self._numbers[id(node)]
        number = self._numbers[id(node)] = len(self.nodes)
        own = SceneNode(node.kind, base_type(node), node.define, parent, [])
        self.nodes.append(own)
        for name, value in _defaults(node, own.base).items():
            if name not in node.fields:
                own.fields.append([name, _type_of_value(name, value), value])
        for name, field in node.fields.items():
            own.fields.append([name, *self._value(name, field, number)])
        return number

    def _value(self, name: str, field: WbtField, parent: int) -> tuple[int, Any]:
        items: list[Any] = [
            self._add(item, parent) if isinstance(item, WbtNode) else item
            for item in field.items
        ]
        if any(isinstance(item, WbtNode) or item is None for item in field.items):
            numbers = [-1 if item is None else item for item in items]
            if name in _LISTS or len(numbers) > 1:
                return MF + SF_NODE, [number for number in numbers if number >= 0]
            return SF_NODE, numbers[0]
        return _typed(name, field.items)


def base_type(node: WbtNode) -> str:
    """Node type; for a PROTO, its base type."""
    if is_epuck(node) or node.kind in ROBOTS:
        return "Robot"
    if node.kind in _SOLID_PROTOS or node.kind in HOUSEHOLD:
        return "Solid"
    return _BACKGROUNDS.get(node.kind, node.kind)


def _defaults(node: WbtNode, base: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    if base in ("Solid", "Robot", "Pose", "Transform"):
        values |= {key: list(value) for key, value in _POSE.items()}
    if base == "Robot":
        values |= _ROBOT_FIELDS
    if node.kind in ("Solid", "Robot", "Group", "Pose", "Transform"):
        values["children"] = []
    if base in ("Solid", "Robot"):
        values["name"] = _NAMES.get(node.kind, node.kind)
    return values | _SOLID_PROTOS.get(node.kind, {})


def _type_of_value(name: str, value: Any) -> int:
    items = tuple(value) if isinstance(value, list) else (value,)
    return _typed(name, items)[0]


def _typed(name: str, items: tuple[Item, ...]) -> tuple[int, Any]:
    """Type and value of a field that contains no nodes."""
    values = list(items)
    if name in _LISTS:
        kind = _LISTS[name]
        return kind, _grouped(values, kind - MF)
    for kind, python in ((SF_BOOL, bool), (SF_STRING, str)):
        if values and all(type(value) is python for value in values):
            return (kind, values[0]) if len(values) == 1 else (MF + kind, values)
    if len(values) == 1:
        if name in _INTEGERS:
            return SF_INT32, int(float(str(values[0])))
        return SF_FLOAT, values[0]
    by_length = {2: SF_VEC2F, 3: SF_COLOR if "olor" in name else SF_VEC3F}
    kind = by_length.get(len(values), SF_ROTATION if len(values) == 4 else 0)
    return (kind, values) if kind else (MF + SF_FLOAT, values)


def _grouped(values: list[Any], kind: int) -> list[Any]:
    if kind == SF_INT32:
        return [int(value) for value in values]
    width = _WIDTH.get(kind, 1)
    if width == 1:
        return values
    return [values[k : k + width] for k in range(0, len(values) - width + 1, width)]
