"""Variations of a controller without a language model: other numbers at its top."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from dataclasses import fields
from typing import NamedTuple

import numpy as np

from tdac_agent.builtin.template import P

STEP = 0.15
"""Standard deviation of a change of a parameter, as a part of its range."""
SPREAD = 0.25
"""Standard deviation of the logarithm of a factor."""
MOST_CHANGED = 2
DIGITS = 3


def varied_parameters(
    parameters: P, seed: tuple[int, ...]
) -> tuple[P, tuple[str, ...]]:
    """Moves one or two parameters of a template by random steps within their bounds.

    Args:
        parameters: The parameters.
        seed: Seed of the choice and of the steps.

    Returns:
        The variation, and a note for each change, as `varied` has them.
    """
    random = np.random.default_rng(seed)
    known, changed = fields(parameters), parameters
    count = 1 + int(random.integers(MOST_CHANGED))
    for number in sorted(random.choice(len(known), count, replace=False).tolist()):
        name, bounds = known[number].name, known[number].metadata
        low, high, value = bounds["low"], bounds["high"], getattr(parameters, name)
        step = STEP * (high - low) * float(random.standard_normal())
        inside = low <= value + step <= high
        changed = changed.changed(**{name: value + step if inside else value - step})
    notes = [
        f"{name.upper()} {before:g} -> {after:g}"
        for name in (item.name for item in known)
        if (before := getattr(parameters, name)) != (after := getattr(changed, name))
    ]
    return changed, tuple(notes)


def varied(source: str, seed: tuple[int, ...]) -> tuple[str, tuple[str, ...]]:
    """Multiplies one or two constants at the top level by random factors near 1.

    Args:
        source: A controller.
        seed: Seed of the choice and of the factors.

    Returns:
        The variation, and a note such as `MARGIN 0.02 -> 0.024` for each change; the
        source and no notes if it has no constants.
    """
    random = np.random.default_rng(seed)
    constants = list(_constants(source))
    if not constants:
        return source, ()
    count = min(len(constants), 1 + int(random.integers(MOST_CHANGED)))
    chosen = sorted(random.choice(len(constants), count, replace=False).tolist())
    lines, notes = source.encode().splitlines(keepends=True), list[str]()
    for number in reversed(chosen):  # from the end, so that columns stay valid
        constant = constants[number]
        value, line = _other(constant.value, random), lines[constant.line]
        text = line[: constant.first] + value.encode() + line[constant.end :]
        lines[constant.line] = text
        notes.insert(0, f"{constant.name} {constant.value:g} -> {value}")
    return b"".join(lines).decode(), tuple(notes)


class _Constant(NamedTuple):
    """A positive number, and where it is: line and columns in bytes, from 0."""

    name: str
    value: float
    line: int
    first: int
    end: int


def _constants(source: str) -> Iterator[_Constant]:
    """The positive numbers that are assigned to names in capitals."""
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            continue
        names, values = _parts(node.targets[0]), _parts(node.value)
        for name, part in zip(names, values, strict=False):
            match name, part:
                case ast.Name(id=word), ast.Constant(value=float() | int() as number):
                    end = part.end_col_offset
                    known = word.isupper() and not isinstance(number, bool)
                    if known and 0 < number < math.inf and end is not None:
                        line = part.lineno - 1
                        yield _Constant(word, number, line, part.col_offset, end)


def _parts(node: ast.expr) -> list[ast.expr]:
    """The elements of a tuple; any other expression alone."""
    return node.elts if isinstance(node, ast.Tuple) else [node]


def _other(value: float, random: np.random.Generator) -> str:
    """Another number near a positive one, of the same type."""
    factor = math.exp(SPREAD * random.standard_normal())
    if isinstance(value, int):
        changed = max(1, round(value * factor))
        return str(changed if changed != value else value + 1)
    return repr(float(f"{value * factor:.{DIGITS}g}"))
