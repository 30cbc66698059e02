"""Progress of requests: what an agent is told while the judge works."""

import pytest

from tdac_agent.mcp.watch import Watch


@pytest.mark.parametrize("what", ["worlds", "episodes"])
def test_it_knows_how_many_drives_there_are(what):
    """On a task set they are worlds, on a task blind drives."""
    watch, steps = Watch(), []
    watch.begin(steps.append)
    watch.record({"event": "drive.start", what: 110})
    watch.record({"event": "drive.step", "done": 3})
    assert [(step.progress, step.total) for step in steps] == [(3, 110)]
