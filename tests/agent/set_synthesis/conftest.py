"""Fixtures of the tests of writing for a task set."""

import pytest
from few_worlds import KNOWN, write_set

from tdac_envs import load_set


@pytest.fixture
def few(tmp_path):
    """A set that `known.py` solves."""
    return load_set(write_set(tmp_path / "few.yaml"))


@pytest.fixture(scope="session")
def solver():
    """The source of a controller that reaches all goals of `few`."""
    return KNOWN.read_text()
