"""Our own controllers of the levels on sets that only differ in their disturbances."""

import pytest

from tdac_agent.builtin.level import LEVELS
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set


@pytest.mark.slow
def test_noisy_ranges():
    """With noise on each ray, it still arrives on most worlds within its CPU budget."""
    controller = LEVELS / "unknown.py"
    report = verify_episodes(controller, load_set("barn-slow"), 8, split="dev")
    assert report.successes >= 5


@pytest.mark.slow
def test_a_robot_whose_pose_scan_and_wheels_err():
    """On a floor in metres, within its CPU budget."""
    report = verify_episodes(LEVELS / "floor.py", load_set("floor"), 8, split="dev")
    assert report.successes >= 7
