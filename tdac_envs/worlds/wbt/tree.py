"""Parses a `.wbt` file into nodes; keeps all types and fields as written."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace

from tdac_envs.core.errors import WorldFileError
from tdac_envs.worlds.wbt.tokens import Kind, SourceText, Token, tokens

DEEPEST = 100
"""Maximum depth of nested nodes, so that no file exhausts the stack."""
MOST_NODES = 20_000
"""Maximum number of nodes; a USE counts as much as the node that it refers to."""

_HEADER = re.compile(r"#VRML(?:_\w+)? +(\S+)(?: +utf8)?[^\S\n]*(?:\n|$)")
_VERSION = re.compile(r"[RV]?(\d{1,6})(?:\.(\d{1,6})|([a-z]))?")
_KEYWORDS = {"IS", "PROTO", "EXTERNPROTO", "IMPORTABLE", "DEF", "USE"}
_CONSTANTS = {"TRUE": True, "FALSE": False, "NULL": None}


@dataclass(frozen=True, slots=True, eq=False)
class WbtField:
    """The value of a field.

    Attributes:
        items: Values: one item for a single value, all numbers for a vector.
        offset: Index of the first character in the text.
    """

    items: tuple[Item, ...]
    offset: int


@dataclass(frozen=True, slots=True, eq=False)
class WbtNode:
    """A node.

    Attributes:
        kind: Node or PROTO type.
        define: Its DEF name, or empty.
        fields: Fields by name.
        source: Text that contains the node.
        offset: Index of the first character in the text.
        size: Number of nodes in it, itself included.
    """

    kind: str
    define: str
    fields: dict[str, WbtField]
    source: SourceText
    offset: int
    size: int

    def error(self, message: str, field: str = "") -> WorldFileError:
        """An error at one of the fields, or at the node."""
        at = self.fields[field].offset if field in self.fields else self.offset
        return self.source.error(at, message)

    @property
    def line(self) -> int:
        """Line number, from 1."""
        return self.source.line(self.offset)


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """A parsed file.

    Attributes:
        nodes: Top-level nodes.
        version: Version in the header, e.g. "R2025a".
        release: The version as comparable numbers, e.g. (2025, 1) or (8, 6).
    """

    nodes: tuple[WbtNode, ...]
    version: str
    release: tuple[int, int]


def parse(text: str, name: str) -> Document:
    """Parses the text of a file.

    Args:
        text: Text; lines may end in LF, CR or both.
        name: File name for errors.

    Raises:
        WorldFileError: The text is not a Webots world; the message gives the position.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    source = SourceText(name, text)
    header = _HEADER.match(text)
    found = _VERSION.match(header[1]) if header else None
    if header is None or found is None:
        raise source.error(
            0, "expected a header such as '#VRML_SIM R2025a utf8' on the first line"
        )
    minor = int(found[2] or 0) if not found[3] else ord(found[3]) - ord("a") + 1
    nodes = _Parser(source, tokens(source, header.end())).world()
    return Document(nodes, header[1], (int(found[1]), minor))


Item = float | str | bool | WbtNode | None


def rebuilt(
    node: WbtNode, change: Callable[[WbtNode], WbtNode], without: Collection[str] = ()
) -> WbtNode:
    """The node with changed inner nodes; the same if nothing changes.

    Args:
        node: The node.
        change: Returns the node that takes the place of an inner one.
        without: Names of fields that are left out.
    """
    fields: dict[str, WbtField] = {}
    for name, own in node.fields.items():
        if name not in without:
            items = tuple(change(i) if isinstance(i, WbtNode) else i for i in own.items)
            same = all(new is old for new, old in zip(items, own.items, strict=True))
            fields[name] = own if same else WbtField(items, own.offset)
    if all(fields.get(name) is own for name, own in node.fields.items()):
        return node
    return with_fields(node, fields)


def with_fields(node: WbtNode, fields: dict[str, WbtField]) -> WbtNode:
    """The node with other fields."""
    parts = (item for own in fields.values() for item in own.items)
    size = 1 + sum(part.size for part in parts if isinstance(part, WbtNode))
    return replace(node, fields=fields, size=size)


class _Parser:
    """Recursive-descent parser; keeps the next token and the DEF names so far."""

    def __init__(self, source: SourceText, stream: Iterator[Token]) -> None:
        self._source, self._stream = source, stream
        self._next = next(stream)
        self._defined: dict[str, WbtNode] = {}

    def world(self) -> tuple[WbtNode, ...]:
        nodes, size = list[WbtNode](), 0
        while self._next.kind != "end":
            if self._next.text in {"EXTERNPROTO", "IMPORTABLE"}:
                self._extern()
                continue
            node = self._node(0)
            if node is not None:
                nodes.append(node)
                size += node.size
                self._bounded(size, node)
        return tuple(nodes)

    def _extern(self) -> None:
        if self._take().text == "IMPORTABLE" and self._next.text != "EXTERNPROTO":
            raise self._unexpected("EXTERNPROTO after IMPORTABLE")
        if self._next.kind == "word":
            self._take()
        if self._next.kind != "string":
            raise self._unexpected("the URL of a PROTO in quotes")
        self._take()

    def _node(self, depth: int) -> WbtNode | None:
        """Parses a node, the USE of a node, or NULL."""
        begin = self._next
        if depth > DEEPEST:
            raise self._unexpected(f"at most {DEEPEST} nested nodes")
        if self._skip("word", "NULL"):
            return None
        if self._skip("word", "USE"):
            return self._used(self._name("the name of a node after USE"))
        define = ""
        if self._skip("word", "DEF"):
            define = self._name("a name after DEF").text
        kind = self._name("a node").text
        before = self._defined.get(define)
        fields = self._body(kind, depth)
        size = 1 + sum(
            item.size
            for field in fields.values()
            for item in field.items
            if isinstance(item, WbtNode)
        )
        node = WbtNode(kind, define, fields, self._source, begin.offset, size)
        self._bounded(size, node)
        # A nested node of the same DEF name takes precedence.
        if define and self._defined.get(define) is before:
            self._defined[define] = node
        return node

    def _bounded(self, size: int, node: WbtNode) -> None:
        if size > MOST_NODES:
            raise node.error(f"expected at most {MOST_NODES} nodes, got {size}")

    def _used(self, name: Token) -> WbtNode:
        if name.text not in self._defined:
            raise self._source.error(
                name.offset, f"USE {name.text}: there is no DEF {name.text} before it"
            )
        return self._defined[name.text]

    def _body(self, kind: str, depth: int) -> dict[str, WbtField]:
        if not self._skip("mark", "{"):
            raise self._unexpected(f"'{{' after {kind}")
        fields: dict[str, WbtField] = {}
        while self._next.kind == "word":
            name = self._take()
            if name.text in _KEYWORDS or name.text in _CONSTANTS:
                raise self._source.error(
                    name.offset, f"expected a field of {kind}, got {name.text}"
                )
            if name.text == "hidden":
                hidden = self._name("a field after 'hidden'")
                self._field(hidden.text, depth)
            else:
                fields[name.text] = self._field(name.text, depth)
        if not self._skip("mark", "}"):
            raise self._unexpected(f"a field of {kind} or '}}'")
        return fields

    def _field(self, name: str, depth: int) -> WbtField:
        offset, items = self._next.offset, []
        if self._skip("mark", "["):
            while not self._skip("mark", "]"):
                items.append(self._item(f"a value of {name} or ']'", depth))
        elif self._next.kind == "number":
            while self._next.kind == "number":
                items.append(self._item("a number", depth))
        else:
            items.append(self._item(f"a value of {name}", depth))
        return WbtField(tuple(items), offset)

    def _item(self, wanted: str, depth: int) -> Item:
        token = self._next
        if token.kind == "number":
            return float(self._take().text)
        if token.kind == "string":
            return self._take().text
        if token.kind == "word" and token.text in {"TRUE", "FALSE"}:
            return _CONSTANTS[self._take().text]
        if token.kind == "word" and token.text == "IS":
            raise self._unexpected(f"{wanted}; IS is allowed only in .proto files")
        if token.kind == "word":
            return self._node(depth + 1)
        raise self._unexpected(wanted)

    def _name(self, wanted: str) -> Token:
        if self._next.kind != "word" or self._next.text in _CONSTANTS.keys() | {"IS"}:
            raise self._unexpected(wanted)
        return self._take()

    def _skip(self, kind: Kind, text: str) -> bool:
        """Consumes the next token if it matches."""
        if self._next.kind != kind or self._next.text != text:
            return False
        self._take()
        return True

    def _take(self) -> Token:
        token = self._next
        if token.kind != "end":
            self._next = next(self._stream)
        return token

    def _unexpected(self, wanted: str) -> WorldFileError:
        got = self._next.text if self._next.kind == "end" else repr(self._next.text)
        got = got if len(got) <= 50 else got[:47] + "…'"
        return self._source.error(self._next.offset, f"expected {wanted}, got {got}")
