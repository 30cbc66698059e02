"""Campaigns whose processes are killed with -9: no run is lost, none is there twice."""

import os
from importlib.util import find_spec

import pytest
from killing import check_same_in_the_end, ray_workers

from tdac_agent.executors.on_ray import _start

ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")


@pytest.mark.slow
def test_a_worker_and_a_driver_are_killed(tmp_path):
    """A sample of the next one."""
    check_same_in_the_end(tmp_path, runs=1, kills=2, seconds=6.0)


@pytest.mark.slow
def test_workers_and_drivers_are_killed_twenty_times(tmp_path):
    """At random moments, in one campaign."""
    check_same_in_the_end(tmp_path, runs=6, kills=20, seconds=12.0)


@ray
@pytest.mark.slow
def test_tasks_on_ray_do_not_stand_behind_all_others():
    """A judge of low priority would starve beside whatever else is at work."""
    started = _start(1)

    def priority():
        return os.nice(0)

    try:
        task = started.remote(num_cpus=1)(priority)
        assert started.get(task.remote()) == os.nice(0)
    finally:
        started.shutdown()


@ray
@pytest.mark.slow
def test_tasks_and_drivers_are_killed_on_a_ray_cluster(tmp_path):
    """Three times, on a cluster of two CPUs that is started for it."""
    flags = ("--executor", "ray", "--workers", 2)
    check_same_in_the_end(tmp_path, 3, 3, 25.0, ray_workers, flags)
