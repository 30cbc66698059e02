"""Mutants of good controllers: domain-specific mistakes, and those of cosmic-ray."""

from __future__ import annotations

import ast
import difflib
import functools
import random
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.domain_mutations import DOMAIN
from benchmarks.epuck_mutations import DOMAIN_EPUCK
from benchmarks.mutation_rules import Rule
from benchmarks.source import Source
from tdac_agent.tasks.task_file import Profile

RULES: dict[str, dict[str, Rule]] = {"map2d": DOMAIN, "epuck": DOMAIN_EPUCK}
"""Rules for domain-specific mistakes, by kind of task."""


@dataclass(frozen=True, slots=True)
class Original:
    """A good controller for a kind of task."""

    name: str
    profile: Profile
    text: str
    kind: str = "map2d"


def originals_in(folder: Path, kind: str = "map2d") -> list[Original]:
    """The controllers of a folder; each names its profile in a comment."""
    found = []
    for path in sorted(folder.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        profile = re.search(r"^# profile: (\w+)", text, re.MULTILINE)
        if profile and profile[1] == "paper":
            found.append(Original(path.stem, "paper", text, kind))
        elif profile and profile[1] == "policy":
            found.append(Original(path.stem, "policy", text, kind))
    return found


@dataclass(frozen=True, slots=True)
class Mutant:
    """A controller with one change.

    Attributes:
        mutation: Name of the change.
        original: The unchanged controller.
        text: The changed source.
    """

    mutation: str
    original: Original
    text: str

    def change(self) -> tuple[int, str]:
        """Number of the first changed line in the original, and its new text."""
        before = self.original.text.splitlines()
        after = self.text.splitlines()
        matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
        for tag, i, _, j0, j1 in matcher.get_opcodes():
            if tag != "equal":
                return i + 1, " ".join(line.strip() for line in after[j0:j1])
        return 0, ""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A possible mutant, made on demand."""

    mutation: str
    original: Original
    make: Callable[[], str]


def choose(
    originals: Sequence[Original], domain: int, syntactic: int, seed: int
) -> list[Mutant]:
    """A seeded sample that is balanced over mutations and controllers.

    Mutants that equal their original or another mutant, or that do not parse, are
    excluded.

    Args:
        originals: Good controllers.
        domain: Number of mutants from domain-specific mistakes.
        syntactic: Number of mutants from cosmic-ray, which only a number above 0 needs.
        seed: Seed of the sample.
    """
    draw = random.Random(seed)
    seen = {normal(item.text) for item in originals} | {None}
    pool = [mutant for item in originals for mutant in domain_mutants(item)]
    chosen = _by_turns(pool, domain, draw, seen)
    if syntactic:
        pool = [mutant for item in originals for mutant in library_mutants(item)]
        chosen += _by_turns(pool, syntactic, draw, seen)
    return chosen


def domain_mutants(original: Original) -> Iterator[Candidate]:
    """Every mutant of a controller by the rules for its kind of task."""
    source = Source(original.text)
    for name, rule in RULES[original.kind].items():
        for node in ast.walk(source.tree):
            for target, text in rule(node, source):
                make = functools.partial(source.replaced, target, text)
                yield Candidate(name, original, make)


def library_mutants(original: Original) -> Iterator[Candidate]:
    """Every mutant of a controller by the operators of cosmic-ray."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    nodes = list(ast_nodes(get_ast(original.text)))
    for name in sorted(operator_names()):
        # These two need names of variables as arguments.
        if name.endswith(("VariableReplacer", "VariableInserter")):
            continue
        operator = get_operator(name)()
        places = sum(len(list(operator.mutation_positions(node))) for node in nodes)
        # All pairs as in "core/ReplaceBinaryOperator_Add_Sub" are one family.
        family = name.rpartition("/")[2].partition("_")[0]
        for place in range(places):
            make = functools.partial(mutate_code, original.text, operator, place)
            yield Candidate(family, original, make)


def normal(text: str) -> str | None:
    """The syntax tree without docstrings, as text; None if it does not parse."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return None
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [s for s in body if not _is_text(s)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _by_turns(
    pool: list[Candidate], count: int, draw: random.Random, seen: set[str | None]
) -> list[Mutant]:
    """Takes one mutant of each mutation in turn, varying the controllers."""
    queues: dict[str, list[Candidate]] = {}
    for item in draw.sample(pool, len(pool)):
        queues.setdefault(item.mutation, []).append(item)
    chosen: list[Mutant] = []
    taken: Counter[str] = Counter()
    while len(chosen) < count and any(queues.values()):
        for name in sorted(queues):
            mutant = _next(queues[name], taken, seen) if len(chosen) < count else None
            if mutant is not None:
                taken[mutant.original.name] += 1
                chosen.append(mutant)
    return chosen


def _next(
    queue: list[Candidate], taken: Counter[str], seen: set[str | None]
) -> Mutant | None:
    """The next new mutant, from the controller with the fewest mutants so far."""
    queue.sort(key=lambda item: taken[item.original.name], reverse=True)
    while queue:
        item = queue.pop()
        text = item.make()
        key = normal(text)
        if key not in seen:
            seen.add(key)
            return Mutant(item.mutation, item.original, text)
    return None
