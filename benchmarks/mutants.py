"""Mutants of good controllers: by the domain's own mistakes, and by cosmic-ray's."""

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
"""The domain's mistakes, by kind of task."""


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
        original: What was changed.
        text: The changed source.
    """

    mutation: str
    original: Original
    text: str

    def change(self) -> tuple[int, str]:
        """First changed line, its number in the original and what it became."""
        before = self.original.text.splitlines()
        after = self.text.splitlines()
        matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
        for tag, i, _, j0, j1 in matcher.get_opcodes():
            if tag != "equal":
                return i + 1, " ".join(line.strip() for line in after[j0:j1])
        return 0, ""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A mutant that may be made."""

    mutation: str
    original: Original
    make: Callable[[], str]


def choose(
    originals: Sequence[Original], domain: int, syntactic: int, seed: int
) -> list[Mutant]:
    """A seeded sample that gives every mutation and every controller its turn.

    Mutants that equal their original or another one, or that do not parse, are not
    taken.

    Args:
        originals: Good controllers.
        domain: Number of mutants from the domain's own mistakes.
        syntactic: Number of mutants from cosmic-ray, which is needed above 0 only.
        seed: Of the sample.
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
    """Every mutant of a controller that the rules of its kind of task know."""
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
        # These two want the names of variables as arguments.
        if name.endswith(("VariableReplacer", "VariableInserter")):
            continue
        operator = get_operator(name)()
        places = sum(len(list(operator.mutation_positions(node))) for node in nodes)
        # "core/ReplaceBinaryOperator_Add_Sub": one family for all pairs.
        family = name.rpartition("/")[2].partition("_")[0]
        for place in range(places):
            make = functools.partial(mutate_code, original.text, operator, place)
            yield Candidate(family, original, make)


def normal(text: str) -> str | None:
    """The syntax tree without docstrings as text; None where it does not parse."""
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
    """Takes one mutant of each mutation, then again, each from another controller."""
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
    """The next new mutant, of the controller that had the fewest turns."""
    queue.sort(key=lambda item: taken[item.original.name], reverse=True)
    while queue:
        item = queue.pop()
        text = item.make()
        key = normal(text)
        if key not in seen:
            seen.add(key)
            return Mutant(item.mutation, item.original, text)
    return None
