"""Static contract (Table I): compliance and hygiene, read from the source alone."""

import ast

import pytest

from tdac_agent import contract, hygiene


def test_source_parses(controller):
    """One Python file of at most 200 kB that parses."""
    assert isinstance(controller.tree, ast.Module)


def test_imports(controller):
    """Only allowed modules are imported, and only at the top level."""
    problems = contract.import_problems(controller.tree)
    allowed = " ".join(sorted(contract.ALLOWED_IMPORTS - {"__future__"}))
    assert not problems, f"{'; '.join(problems)}; allowed at the top: {allowed}"


def test_policy_is_defined(controller):
    """`policy` is a plain function that takes one observation."""
    function = contract.top_level_names(controller.tree).get("policy")
    assert isinstance(function, ast.FunctionDef), "no `def policy(obs)` at the top"
    least, most = contract.positional_arity(function)
    assert least <= 1 <= most, f"policy takes {least}..{most} arguments, not 1"


@pytest.mark.paper
def test_constants(controller):
    """The constants of the contract are assigned at the top level."""
    names = contract.top_level_names(controller.tree)
    missing = [name for name in contract.CONSTANTS_2D if name not in names]
    assert not missing, f"missing constants: {', '.join(missing)}"


@pytest.mark.paper
def test_entry_points(controller):
    """`run_episode`, `main`, the map class and the planner functions are there."""
    names = contract.top_level_names(controller.tree)
    functions = ("nearest_free", "plan_path", "run_episode", "main")
    missing = [f for f in functions if not isinstance(names.get(f), ast.FunctionDef)]
    if not isinstance(names.get("OccMap2D"), ast.ClassDef):
        missing.append("OccMap2D (a class)")
    assert not missing, f"missing at the top level: {', '.join(missing)}"


@pytest.mark.paper
def test_main(controller):
    """`main()` calls `sensors.show(policy)`, and the `__main__` guard calls it."""
    main = contract.top_level_names(controller.tree).get("main")
    assert isinstance(main, ast.FunctionDef), "no `def main()` at the top level"
    assert "show" in contract.calls_in(main), (
        "main() does not call sensors.show(policy)"
    )
    guarded = contract.has_main_guard(controller.tree)
    assert guarded, 'no `if __name__ == "__main__": main()`'


@pytest.mark.parametrize("pattern", hygiene.HYGIENE)
def test_hygiene(controller, pattern):
    """No unstable pattern: each is named with its line."""
    found = list(hygiene.HYGIENE[pattern](controller.tree))
    assert not found, f"{pattern.replace('_', ' ')}: {'; '.join(found[:8])}"
