"""Typed access to the fields of a node."""

from __future__ import annotations

from tdac_envs.core.errors import WorldFileError
from tdac_envs.worlds.wbt.tree import WbtNode

LARGEST = 1e6
"""Largest absolute value of a number; real worlds span only a few metres."""


class StrayError(WorldFileError):
    """A number beyond `LARGEST`."""


def numbers(node: WbtNode, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """The numbers of a field; `default` also sets their count.

    Raises:
        WorldError: The field has other values, or a number beyond `LARGEST`.
    """
    if name not in node.fields:
        return default
    items = node.fields[name].items
    found = tuple(n for n in items if isinstance(n, float))
    if len(found) != len(items) or len(found) != len(default):
        wanted = "1 number" if len(default) == 1 else f"{len(default)} numbers"
        raise node.error(f"expected {wanted} for {name} of {node.kind}", name)
    if any(abs(number) > LARGEST for number in found):
        message = f"{name} of {node.kind} is beyond {LARGEST:g}"
        raise StrayError(str(node.error(message, name)))
    return found


def number(node: WbtNode, name: str, default: float) -> float:
    """The number of a field; raises as `numbers` does."""
    return numbers(node, name, (default,))[0]


def positive(
    node: WbtNode, name: str, default: float, instead: float | None = None
) -> float:
    """A number above 0.

    Args:
        node: The node.
        name: The field.
        default: Value of a missing field.
        instead: Value instead of one that is not above 0; by default the default.

    Raises:
        WorldError: As by `numbers`.
    """
    found = number(node, name, default)
    if found > 0.0:
        return found
    return default if instead is None else instead


def number_list(node: WbtNode, name: str) -> tuple[float, ...]:
    """All numbers of a field; raises as `numbers` does."""
    count = len(node.fields[name].items) if name in node.fields else 0
    return numbers(node, name, (0.0,) * count)


def text(node: WbtNode, name: str, default: str = "") -> str:
    """The string of a field.

    Raises:
        WorldError: The field is not a string.
    """
    if name not in node.fields:
        return default
    items = node.fields[name].items
    if len(items) != 1 or not isinstance(items[0], str):
        raise node.error(f"expected a string for {name} of {node.kind}", name)
    return items[0]


def flag(node: WbtNode, name: str, default: bool) -> bool:
    """The boolean of a field.

    Raises:
        WorldError: The field is neither TRUE nor FALSE.
    """
    if name not in node.fields:
        return default
    items = node.fields[name].items
    if len(items) != 1 or not isinstance(items[0], bool):
        raise node.error(f"expected TRUE or FALSE for {name} of {node.kind}", name)
    return items[0]


def child(node: WbtNode, name: str) -> WbtNode | None:
    """The node of a field; None if it is NULL or the field is missing.

    Raises:
        WorldError: The field is not a single node.
    """
    found = children(node, name)
    if len(found) > 1:
        raise node.error(f"expected one node for {name} of {node.kind}", name)
    return found[0] if found else None


def children(node: WbtNode, name: str = "children") -> tuple[WbtNode, ...]:
    """The nodes of a field, without NULLs.

    Raises:
        WorldError: The field has values that are not nodes.
    """
    if name not in node.fields:
        return ()
    items = [item for item in node.fields[name].items if item is not None]
    found = tuple(item for item in items if isinstance(item, WbtNode))
    if len(found) != len(items):
        raise node.error(f"expected nodes for {name} of {node.kind}", name)
    return found
