"""A studio in a process of its own."""

import pytest
from studio_process import Studio


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """One for all tests of a file: a start takes seconds."""
    pytest.importorskip("nicegui", reason="needs tdac[studio]")
    place = tmp_path_factory.mktemp("studio") / "place"
    place.mkdir()
    running = Studio(place)
    running.start()
    yield running
    running.kill()
