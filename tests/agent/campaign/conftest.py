"""A campaign that needs little time."""

import pytest
from few_runs import Small


@pytest.fixture
def small(tmp_path):
    """A campaign in a folder of its own."""
    return Small(tmp_path)
