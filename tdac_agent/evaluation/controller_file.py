"""Checks of a controller file before an evaluation, from its source alone."""

from __future__ import annotations

from tdac_agent.errors import ControllerFileError
from tdac_agent.verification.suite.contract import (
    ALLOWED_IMPORTS,
    ParseError,
    import_problems,
    parse_source,
    top_level_names,
)

MOST_PROBLEMS = 3


def check_controller(name: str, source: bytes) -> None:
    """Refuses a file that is not a controller or that imports a forbidden module.

    An evaluation does not run the tests of the contract. Without this check, a
    controller could be compared with others although `tdac verify` refuses it.

    Args:
        name: The file as the user named it.
        source: Its bytes.

    Raises:
        ControllerFileError: The file is not a Python file, defines no `policy`, or
            imports a module that is not allowed.
    """
    try:
        tree = parse_source(source)
    except ParseError as error:
        raise ControllerFileError(f"{name!r} is not a controller: {error}") from error
    if "policy" not in top_level_names(tree):
        raise ControllerFileError(
            f"{name!r} is not a controller: it defines no function policy(obs)"
        )
    if problems := import_problems(tree):
        more = len(problems) - MOST_PROBLEMS
        told = "; ".join(problems[:MOST_PROBLEMS])
        told += f"; and {more} more" if more > 0 else ""
        allowed = " ".join(sorted(ALLOWED_IMPORTS - {"__future__"}))
        raise ControllerFileError(
            f"{name!r} is not a controller that tdac verify accepts: {told}; allowed "
            f"modules: {allowed}"
        )
