"""Expands the PROTOs of a project: replaces each by the nodes of which it consists.

A PROTO is read if its file is in the folder of the world, in `protos` there, or in the
project's `protos`; nothing is downloaded. PROTOs with template statements, and those
that the reader models itself, are not expanded.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from tdac_envs.core.errors import WorldError
from tdac_envs.core.intake import read_file
from tdac_envs.worlds.wbt.arenas import ARENAS
from tdac_envs.worlds.wbt.protos import PROTOS
from tdac_envs.worlds.wbt.robots import ROBOTS, is_epuck
from tdac_envs.worlds.wbt.tree import (
    Document,
    Item,
    WbtField,
    WbtNode,
    parse,
    rebuilt,
    with_fields,
)

LARGEST_PROTO = 2_000_000
"""Maximum size of a PROTO file, bytes."""
DEEPEST = 8
"""Maximum depth of nested PROTOs."""

_HEAD = re.compile(r"^\s*PROTO\s+(\S+)\s*\[", re.MULTILINE)
_COMMENT = re.compile(r'("(?:[^"\\\n]|\\.)*")|#[^\n]*')
_FIELD = re.compile(
    r"\b(?:field|vrmlField|hiddenField|deprecatedField|unconnectedField|w3dField)\s+"
    r"[SM]F\w+(?:\s*\{[^}]*\})?\s+(\w+)"
)
_IS = re.compile(r"\bIS\s+(\w+)")
_MARK = "TdacFieldOfProto"
_NAME = re.compile(r"[\w-]+")


@dataclass(frozen=True, slots=True, eq=False)
class Proto:
    """A PROTO.

    Attributes:
        defaults: Default values of its fields.
        body: The node of which it consists, with marks where it uses a field.
    """

    defaults: dict[str, WbtField]
    body: WbtNode


@dataclass(slots=True)
class ProtoFolder:
    """The PROTOs of a project.

    Attributes:
        folder: Folder of the world file.
        version: Version of the world file.
    """

    folder: Path
    version: str
    _known: dict[str, Proto | None] = field(default_factory=dict)

    def expanded(self, document: Document) -> Document:
        """The document, in which nodes replace the PROTOs that consist of them."""
        nodes = tuple(self._expand(node, 0) for node in document.nodes)
        return replace(document, nodes=nodes)

    def fields(self) -> dict[str, Iterable[str]]:
        """Names of the fields of each PROTO that was expanded."""
        return {kind: proto.defaults for kind, proto in self._known.items() if proto}

    def _expand(self, node: WbtNode, depth: int) -> WbtNode:
        if node.kind in ROBOTS or is_epuck(node):
            return node
        if node.kind not in PROTOS and node.kind not in ARENAS and depth < DEEPEST:
            proto = self._proto(node.kind)
            if proto is not None:
                made = _filled(proto.body, {**proto.defaults, **node.fields})
                define = node.define or made.define
                return self._expand(replace(made, define=define), depth + 1)
        return rebuilt(node, partial(self._expand, depth=depth))

    def _proto(self, kind: str) -> Proto | None:
        if kind not in self._known:
            self._known[kind] = self._read(kind)
        return self._known[kind]

    def _read(self, kind: str) -> Proto | None:
        if not _NAME.fullmatch(kind):
            return None
        folders = (
            self.folder, self.folder / "protos", self.folder.parent / "protos"
        )  # fmt: skip
        for folder in folders:
            try:
                data = read_file(folder / f"{kind}.proto", LARGEST_PROTO)
                return read_proto(data.decode("utf-8", "replace"), kind, self.version)
            except (OSError, WorldError):
                continue
        return None


def read_proto(text: str, kind: str, version: str) -> Proto | None:
    """Reads a PROTO; returns None if it has template statements or another name.

    Args:
        text: Content of the file.
        kind: Name of the PROTO.
        version: Version of the world file.

    Raises:
        WorldError: The file is invalid.
    """
    text = _COMMENT.sub(lambda match: match[1] or "", text)
    head = _HEAD.search(text)
    if head is None or head[1] != kind or "%<" in text or "%{" in text:
        return None
    middle = _closing(text, head.end())
    begin = text.find("{", middle)
    if middle < 0 or begin < 0:
        return None
    fields = _FIELD.sub(r"\1", text[head.end() : middle])
    body = _IS.sub(rf"DEF \1 {_MARK} {{ }}", text[begin + 1 : text.rfind("}")])
    name, header = f"{kind}.proto", f"#VRML_SIM {version} utf8\n"
    (shape,) = parse(f"{header}{_MARK} {{ {fields} }}", name).nodes
    made = parse(header + body, name).nodes
    return Proto(shape.fields, made[0]) if made else None


def _closing(text: str, start: int) -> int:
    """Index of the bracket that closes the one before `start`; -1 if there is none."""
    depth = 1
    for match in re.finditer(r'"(?:[^"\\\n]|\\.)*"|[][]', text[start:]):
        depth += {"[": 1, "]": -1}.get(match[0], 0)
        if depth == 0:
            return start + match.start()
    return -1


def _filled(node: WbtNode, values: dict[str, WbtField]) -> WbtNode:
    """The node with values instead of marks; fields without a value are left out."""
    fields: dict[str, WbtField] = {}
    for name, own in node.fields.items():
        items = tuple(_items(own.items, values))
        if items or not own.items:
            fields[name] = WbtField(items, own.offset)
    return with_fields(node, fields)


def _items(items: Iterable[Item], values: dict[str, WbtField]) -> Iterable[Item]:
    for item in items:
        if not isinstance(item, WbtNode):
            yield item
        elif item.kind == _MARK:
            yield from values[item.define].items if item.define in values else ()
        else:
            yield _filled(item, values)
