"""How pages call the candidates of a run."""


def candidate_name(k: int, j: int) -> str:
    """A candidate by its iteration and, after the first one, its repair."""
    return f"iteration {k}, repair {j}" if j else f"iteration {k}"
