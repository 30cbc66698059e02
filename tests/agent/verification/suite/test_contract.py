"""The static checks, one pattern at a time."""

import ast
import dataclasses
import inspect
import typing

import pytest

from tdac_agent.verification.suite import contract, hygiene

BAD = {
    "forbidden_calls": [
        "eval('1')",
        "x = eval",
        "exec('1')",
        "compile('1', 'a', 'exec')",
        "__import__('os')",
        "globals()['x']",
        "vars()",
        "input()",
        "breakpoint()",
        "().__class__.__bases__",
        "f.__globals__",
        "__builtins__",
    ],
    "file_writes": [
        "open('a', 'w')",
        "open('a', mode='a')",
        "open('a', 'r+')",
        "open('a', MODE)",
        "np.save('a', x)",
        "x.tofile('a')",
        "path.write_text('a')",
        "path.write_bytes(b'a')",
        "open('a', *['w'])",
        "open('a', **{'mode': 'w'})",
    ],
    "sleeps": [
        "time.sleep(1)",
        "import time as t\nt.sleep(1)",
        "from time import sleep",
    ],
    "swallowed_errors": [
        "try:\n    f()\nexcept:\n    g()",
        "try:\n    f()\nexcept Exception:\n    pass",
        "try:\n    f()\nexcept (ValueError, OSError):\n    ...",
        "try:\n    f()\nexcept BaseException:\n    g()",
        "for i in x:\n    try:\n        f()\n    except ValueError:\n        continue",
    ],
    "runtime_errors": ["raise RuntimeError", "raise RuntimeError('a')"],
    "surface_indexing": ["screen[0, 1]", "self.surface[x][y]", "surface[1] = 2"],
    "unseeded_randomness": [
        "import random\nrandom.random()",
        "import random as r\nr.Random()",
        "from random import choice\nchoice([1])",
        "import numpy as np\nnp.random.rand()",
        "import numpy as np\nnp.random.default_rng()",
        "from numpy.random import default_rng\ndefault_rng()",
        "from numpy import random\nrandom.normal()",
        "import random\nrandom.Random(None)",
        "import numpy as np\nnp.random.default_rng(seed=None)",
    ],
}
GOOD = {
    "forbidden_calls": [
        "evaluate(1)",
        "x.compile",
        "re.compile('a')",
        "'eval(1)'",
        "# exec('1')\nx = 1",
        "self.__class__.__name__",
        "def execute(): ...",
        "def __init__(self): ...",
    ],
    "file_writes": [
        "open('a')",
        "open('a', 'rb')",
        "open('a', mode='r')",
        "opened('w')",
    ],
    "sleeps": ["asleep()", "# time.sleep(1)\nx = 1", "'sleep()'", "time.monotonic()"],
    "swallowed_errors": [
        "try:\n    f()\nexcept ValueError:\n    x = 1",
        "try:\n    f()\nexcept ValueError as e:\n    raise KeyError from e",
        "try:\n    f()\nexcept OSError:\n    return_value = None",
        "'except:'",
    ],
    "runtime_errors": [
        "raise ValueError('RuntimeError')",
        "# raise RuntimeError\nx = 1",
    ],
    "surface_indexing": ["occ[y, x]", "screens[0]", "surface.get_at((0, 1))"],
    "unseeded_randomness": [
        "import random\nr = random.Random(3)\nr.random()",
        "import numpy as np\nrng = np.random.default_rng(0)\nrng.normal()",
        "import random\nrandom.seed(1)",
        "random = 3",
    ],
}


@pytest.mark.parametrize(("pattern", "code"), [(p, c) for p in BAD for c in BAD[p]])
def test_each_pattern_is_found(pattern, code):
    """An unstable pattern is named with its line."""
    found = list(hygiene.HYGIENE[pattern](ast.parse(code)))
    assert found
    assert all(problem.startswith("line ") for problem in found)


@pytest.mark.parametrize(("pattern", "code"), [(p, c) for p in GOOD for c in GOOD[p]])
def test_harmless_code_is_left_alone(pattern, code):
    """Comments, strings and names that merely look like it are no finding."""
    assert list(hygiene.HYGIENE[pattern](ast.parse(code))) == []


@pytest.mark.parametrize(
    "code",
    [
        "import os",
        "import numpy.linalg, scipy",
        "from . import x",
        "from os import path",
        "def f():\n    import math",
        "if True:\n    import math",
        "import mathematics",
    ],
)
def test_wrong_imports_are_found(code):
    """Other modules, and imports below the top level."""
    assert contract.import_problems(ast.parse(code))


def test_allowed_imports():
    """Every allowed module, its parts and `__future__` may be imported."""
    lines = [f"import {name}" for name in contract.ALLOWED_IMPORTS - {"__future__"}]
    code = "from __future__ import annotations\nimport numpy.linalg\n"
    assert contract.import_problems(ast.parse(code + "\n".join(lines))) == []


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("A = B = 1", {"A", "B"}),
        ("A, (B, *C) = f()", {"A", "B", "C"}),
        ("A: int = 1", {"A"}),
        ("A: int", set()),
        ("if x:\n    A = 1", {"A"}),
        ("try:\n    A = 1\nexcept OSError:\n    A = 2", {"A"}),
        ("def f():\n    A = 1", {"f"}),
        ("from sensors import load_params as A", {"A"}),
    ],
)
def test_top_level_names(code, names):
    """What a module binds when it is imported."""
    assert set(contract.top_level_names(ast.parse(code))) == names


@pytest.mark.parametrize(
    ("code", "guarded"),
    [
        ("if __name__ == '__main__':\n    main()", True),
        ("if '__main__' == __name__:\n    main()", True),
        ("if __name__ == '__main__':\n    pass", False),
        ("main()", False),
        ("if True:\n    main()", False),
        ("if __name__ != '__main__':\n    main()", False),
    ],
)
def test_main_guard(code, guarded):
    """Only the usual guard that calls `main` counts."""
    assert contract.has_main_guard(ast.parse(code)) is guarded


@pytest.mark.parametrize("module", [ast, contract, dataclasses, typing])
def test_all_nodes_in_order(module):
    """The same nodes as of the standard library's own walk, in its order."""
    tree = ast.parse(inspect.getsource(module))
    ours, theirs = contract.nodes_of(tree), list(ast.walk(tree))
    assert len(ours) == len(theirs)
    assert all(our is their for our, their in zip(ours, theirs, strict=True))
