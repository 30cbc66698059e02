"""Our own controllers of the levels on sets that only differ in their disturbances."""

import pytest

from tdac_agent.builtin.level import LEVELS
from tdac_agent.evaluation.set_verify import verify_on_set
from tdac_envs import load_set


@pytest.mark.slow
def test_noisy_ranges():
    """With noise on each ray, it still arrives on most worlds within its CPU budget."""
    controller = LEVELS / "unknown.py"
    report = verify_on_set(controller, load_set("barn-slow"), "dev", 8)
    assert report.successes >= 5
