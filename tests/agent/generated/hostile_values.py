"""What somebody might write where a file or a flag has an ordinary value."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

HUGE = 10**400
NUMBERS = (
    *(0, -1, 1, 2, 3, 7, -0.0, 0.5, -0.5, 1.5, 100, 4096, 4097, 10**7, 10**7 + 1),
    *(1e9, 1.1e9, -1e9, 1e-9, 1e-10, 2**31, 2**53, 2**63 - 1, 2**63, 2**64, -(2**63)),
    *(1e300, -1e300, 1e-300, 5e-324, HUGE, -HUGE),
    *(float("nan"), float("inf"), float("-inf")),
)
TEXTS = (
    *("", " ", "\0", "a\0b", "\ud800", "\x1b[2J\x1b[Hverified", "a\nb", "\u202e", "é"),
    *("/", ".", "..", "~", "../../x", "/dev/zero", "/dev/null", "-", "--json", "*"),
    *("[bold]x", "[/]", "[/bold]", "%s", "{0}", "{{7*7}}", "$(id)", "a" * 5000),
    *("nan", "1e999", "2001-99-99", "null", "True", "[", "{", "!!python/name:os.x"),
    *("builtin", "maze", "command:true", "verified", "running", "policy", "k01"),
)
STRUCTURES = (
    *(None, True, False, [], {}, [[]], [None], {"": None}, {"a": {"b": []}}),
    [0] * 1000,
    {str(n): n for n in range(300)},
)


def nested(depth: int) -> list[Any]:
    """Lists within each other."""
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


numbers = st.sampled_from(NUMBERS) | st.integers(-(2**65), 2**65) | st.floats()
texts = st.sampled_from(TEXTS) | st.text(
    st.characters(exclude_categories=()), max_size=12
)
anything = numbers | texts | st.sampled_from((*STRUCTURES, nested(30), nested(500)))


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Each place in a value that can be written otherwise, as keys from its root."""
    if path:
        yield path
    if isinstance(value, dict):
        items: Any = value.items()
    else:
        items = enumerate(value) if isinstance(value, list) else ()
    for key, part in items:
        yield from places(part, (*path, key))


def of_its_kind(value: Any) -> st.SearchStrategy[Any]:
    """Hostile values of the kind of one, of which more get past a first check."""
    if isinstance(value, bool) or value is None:
        return anything
    if isinstance(value, int | float):
        return numbers
    return texts if isinstance(value, str) else anything


@st.composite
def altered(draw: st.DrawFn, value: dict[str, Any]) -> dict[str, Any]:
    """A value in which one field is something hostile, gone, doubled, or one more."""
    whole = copy.deepcopy(value)
    path = draw(st.sampled_from(list(places(value))))
    inside: Any = whole
    for key in path[:-1]:
        inside = inside[key]
    kind, last = draw(st.integers(0, 9)), path[-1]
    if kind == 0:
        del inside[last]
    elif kind == 1 and isinstance(inside, list):
        inside.insert(last, copy.deepcopy(inside[last]))
    elif kind == 1:
        inside[draw(texts)] = draw(anything)
    else:
        odd = of_its_kind(inside[last]) if kind < 8 else anything
        inside[last] = copy.deepcopy(draw(odd))
    return whole
