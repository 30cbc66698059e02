"""Mutations of `run_episode`: wrong loops, and reports of what did not happen."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

from benchmarks.source import MeanChange, Source, called, is_call, text_of

FORMS = {
    "lying positions": {
        "positions": (
            "({})[1:]",
            "({})[:-1]",
            "[({})[0]] + ({})[:-1]",
            "[(round(p[0]), round(p[1])) for p in ({})]",
            "[(p[1], p[0]) for p in ({})]",
            "({})[:-1] + [({})[0]]",
        )
    },
    "lying speeds": {
        "speeds": (
            "[2 * s for s in ({})]",
            "[abs(s) for s in ({})]",
            "[0.0 for s in ({})]",
            "({})[:-1]",
            "[0.0] + ({})[:-1]",
            "[s / 75.59 for s in ({})]",
        )
    },
    "lying collisions": {
        "collisions": ("0", "({}) + 1", "float({})", "bool({})", "-({})")
    },
    "lying goal": {
        "goal": (
            "tuple(({}))[::-1]",
            "positions[-1]",
            "(0.0, 0.0)",
            "tuple(float(int(v)) + 0.5 for v in ({}))",
        )
    },
    "lying dt": {"dt": ("2 * ({})", "1000 * ({})", "1.0")},
}


def _entry(name: str) -> Callable[[ast.AST, Source], Iterator[MeanChange]]:
    """A rule that changes or renames one entry of the returned dict."""

    def rule(node: ast.AST, source: Source) -> Iterator[MeanChange]:
        if source.function_of(node) != "run_episode":
            return
        if not isinstance(node, ast.Dict):
            return
        for key, value in zip(node.keys, node.values, strict=True):
            word = key.value if isinstance(key, ast.Constant) else None
            for form in FORMS[name].get(word, ()):
                text = text_of(value)
                yield value, form.format(*[text] * form.count("{}"))
            if key is not None and word in FORMS[name]:
                yield key, f'"{word}_"'

    return rule


def wrong_loop(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """The loop of `run_episode` ends too early, too late or never."""
    if source.function_of(node) != "run_episode":
        return
    if isinstance(node, ast.If):
        yield node.test, "False"
        if isinstance(node.test, ast.BoolOp):
            for value in node.test.values:
                yield node.test, text_of(value)
    if isinstance(node, ast.While):
        yield node.test, "True"
    if is_call(node, "range", 1):
        for form in ("{} + 1", "{} - 1", "2 * {}", "min({}, 40)"):
            yield node.args[0], form.format(text_of(node.args[0]))


def wrong_steps(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """`run_episode` steps another action, or resets again."""
    if source.function_of(node) != "run_episode" or not isinstance(node, ast.Call):
        return
    if called(node) == "step" and node.args:
        action = text_of(node.args[0])
        yield node.args[0], f"tuple(v * 0.5 for v in ({action}))"
        yield node.args[0], f"tuple({action})[::-1]"
    if called(node) == "reset" and not node.args:
        yield node, f"({text_of(node)}, {text_of(node)})[1]"
    if called(node) == "reset" and node.args:
        yield node, "None"


LIES = {
    **{name: _entry(name) for name in FORMS},
    "wrong loop": wrong_loop,
    "wrong steps": wrong_steps,
}
"""Rules by name, as in `domain_mutations.DOMAIN`."""
