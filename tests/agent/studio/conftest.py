"""A studio in a process of its own."""

import pytest
from studio_process import running_studio


@pytest.fixture(scope="session")
def studio(tmp_path_factory):
    """One for all tests: a start takes seconds."""
    pytest.importorskip("nicegui", reason="needs tdac[studio]")
    place = tmp_path_factory.mktemp("studio") / "place"
    place.mkdir()
    with running_studio(place) as running:
        yield running
