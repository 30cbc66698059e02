"""How pages call the candidates of a run, and its tests."""


def candidate_name(k: int, j: int) -> str:
    """A candidate by its iteration and, after the first one, its repair."""
    return f"iteration {k}, repair {j}" if j else f"iteration {k}"


def short_test(test: str) -> str:
    """A test's name without its file and `test_`, with spaces for underscores.

    On a task set, it is a cause of failures, and stays as it is.
    """
    name, bracket, case = (test.partition("::")[2] or test).partition("[")
    return name.removeprefix("test_").replace("_", " ") + bracket + case
