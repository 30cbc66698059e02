"""The first of several names, and how many others there are."""

from __future__ import annotations

from collections.abc import Sequence


def first_of(names: Sequence[str], most: int) -> str:
    """The first `most` names and the number of others, such as `a, b and 3 more`."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def list_tests(tests: Sequence[str], most: int) -> str:
    """The names of the first `most` tests, without files, and the number of others."""
    return first_of([name.rpartition("::")[2] for name in tests], most)
