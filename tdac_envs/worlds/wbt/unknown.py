"""Finds fields that nodes do not have, which Webots and the reader skip."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial

from tdac_envs.core.errors import hint
from tdac_envs.core.intake import printable
from tdac_envs.worlds.wbt.known_fields import GAINED_SCALE, KNOWN, LOST_SCALE
from tdac_envs.worlds.wbt.tokens import SourceText
from tdac_envs.worlds.wbt.tree import Document, WbtNode, rebuilt

MOST_NOTES = 20
_SCALES_CHANGED_IN = (2023, 2)
_OWN = "Webots'"
Own = Mapping[str, Iterable[str]]
Place = tuple[int, SourceText]


def without_odd_scales(document: Document) -> Document:
    """The document without the field `scale` of nodes that do not have it.

    R2023b took it from all nodes but Transform, and gave it to some PROTOs.
    """
    kinds = _without_scale(document)
    return replace(document, nodes=tuple(_without(n, kinds) for n in document.nodes))


def _without_scale(document: Document) -> frozenset[str]:
    """Types without a field `scale` in the release of a file, unlike in others."""
    is_new = document.release >= _SCALES_CHANGED_IN
    return LOST_SCALE if is_new else GAINED_SCALE


def _without(node: WbtNode, kinds: frozenset[str]) -> WbtNode:
    dropped = ("scale",) if node.kind in kinds else ()
    return rebuilt(node, partial(_without, kinds=kinds), dropped)


def unknown_fields(document: Document, own: Own) -> list[str]:
    """Notes on fields that their nodes do not have.

    Args:
        document: The file, before PROTOs are expanded.
        own: Fields of the project's own PROTOs, by name.
    """
    known = {kind: set(names) for kind, names in KNOWN.items()}
    if document.release < _SCALES_CHANGED_IN:
        for kind in LOST_SCALE - {"Pose"}:
            known[kind].add("scale")
        for kind in GAINED_SCALE:
            known[kind].remove("scale")
    known |= {kind: set(names) for kind, names in own.items()}
    found: dict[tuple[str, str], list[Place]] = {}
    for node in _nodes(document.nodes):
        names = known.get(node.kind, node.fields)
        for name, field in node.fields.items():
            if name not in names:
                place = field.offset, node.source
                found.setdefault((node.kind, name), []).append(place)
    notes = [
        _note(kind, name, places, known[kind], "the project's" if kind in own else _OWN)
        for (kind, name), places in list(found.items())[:MOST_NOTES]
    ]
    more = f"{len(found) - MOST_NOTES} further fields are not used, either"
    return [*notes, *([more] if len(found) > MOST_NOTES else [])]


def _note(
    kind: str, name: str, places: list[Place], known: set[str], whose: str
) -> str:
    offset, source = places[0]
    where = f"line {source.line(offset)}"
    if len(places) > 1:
        where += f" and {len(places) - 1} more"
    field, node = printable(name), printable(kind)
    return (
        f"{where}: field {field!r} of {node} is not used; {whose} {node} has no such "
        f"field{hint(field, sorted(known))}"
    )


def _nodes(nodes: Iterable[WbtNode]) -> Iterable[WbtNode]:
    """All nodes in the order of the file, each once although it may be used often."""
    stack, seen = list(nodes)[::-1], set[int]()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        yield node
        inner = (item for own in node.fields.values() for item in own.items)
        stack.extend([item for item in inner if isinstance(item, WbtNode)][::-1])
